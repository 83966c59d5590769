"""A model: one mechanism, one formulation, one route, ready to compute.

model = condyle.derive(mechanism, formulation="momentum", route="core")
solution = model.solve(motion, load)
"""

from __future__ import annotations

import os
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .dynamics import ROUTES
from .dynamics import formulation as formulation_named
from .dynamics.equations import part_names, posture_function, require_closed_form
from .errors import InputError, MechanismError, did_you_mean
from .kinematics.batch import evaluate
from .kinematics.causes import causes, owners, sample_error, unreachable_text
from .kinematics.closure import Closure, coordinate_closure, landmark_closure
from .kinematics.contact import indices
from .kinematics.singularity import SINGULAR, Singularity, measure
from .mechanism.home import (
    characteristic_length,
    dependent_coordinates,
    holding_problems,
    home_problem,
    independent_coordinates,
)
from .mechanism.mechanism import COORDINATES, Mechanism
from .progress import step
from .questions.spec import OUTPUTS
from .status import STATUS_NAMES as STATUS_NAMES
from .status import Status, judge

if TYPE_CHECKING:
    from .kernels.compiled import Compiled
    from .kernels.interpreted import Interpreted
    from .kernels.result import PoseRates, Torques
    from .motion import Load, Motion
    from .results.solution import Solution

DEFAULT_LOAD_POINT = "right_molar"
CONDITION = "condition"
BACKENDS = ("auto", "compiled", "interpreted")
OK, UNREACHABLE, SINGULAR_STATUS = Status.ok, Status.unreachable, Status.singular


@dataclass(frozen=True)
class Posture:
    """The mechanism's configuration at N poses.

    joint, beta, gamma: (N, n) [rad or m, rad, rad], principal values.
    reach:         (N, n), negative where a chain cannot reach its joint.
    contact_point: (N, k, 3) [m], ball centres in {S}.
    contact_normal: (N, k, 3), unit normals of the surfaces there, in {S}.
    cos_gamma:     (N, n); near 0 beta_i and gamma_i lose their meaning.
    """

    joint: np.ndarray
    beta: np.ndarray
    gamma: np.ndarray
    cos_gamma: np.ndarray
    reach: np.ndarray
    contact_point: np.ndarray
    contact_normal: np.ndarray
    singularity: Singularity


@dataclass(frozen=True)
class Evaluation:
    """Everything about N samples, as plain arrays; failed samples are NaN."""

    poses: PoseRates
    torques: Torques
    posture: Posture
    status: np.ndarray


class Model:
    """Inverse dynamics of a mechanism by one formulation and route."""

    def __init__(
        self,
        mechanism: Mechanism,
        formulation: str = "virtual_power",
        route: str = "core",
        backend: str = "auto",
    ) -> None:
        """Derive the equations of motion.

        Args:   backend: compiled, interpreted, or auto (compiled where there is a C compiler).
        Raises: InputError:       for an unknown formulation or route.
                UnsupportedError: where route `direct` has no closed form.
                MechanismError:   if the contacts do not hold the platform at home.
        """
        check_home(mechanism)
        if route not in ROUTES:
            raise InputError(f'no route "{route}".{did_you_mean(route, ROUTES)}')
        if route == "direct":
            require_closed_form(mechanism)
        start = time.perf_counter()
        self.mechanism = mechanism
        self.formulation = formulation_named(formulation).name
        self.route = route
        with step("deriving the equations"):
            self.kernel = choose_kernel(mechanism, self.formulation, route, backend)
        self.derivation_seconds = time.perf_counter() - start

    @property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent coordinates q_EE, in order."""
        return independent_coordinates(self.mechanism)

    @property
    def dependent(self) -> tuple[str, ...]:
        """Names of the coordinates that the contacts determine."""
        return dependent_coordinates(self.mechanism)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that share the torques."""
        return part_names(self.mechanism)

    @cached_property
    def characteristic_length(self) -> float:
        return characteristic_length(self.mechanism)

    @cached_property
    def _posture_function(self):
        return posture_function(self.mechanism)

    @property
    def default_load_point(self) -> str | None:
        """Point for a load that names none: right_molar, or the only one there is."""
        points = self.mechanism.platform.points
        only = next(iter(points)) if len(points) == 1 else None
        return DEFAULT_LOAD_POINT if DEFAULT_LOAD_POINT in points else only

    def load_point(self, name: str | None) -> np.ndarray:
        """Where a load acts, (3,) [m] in {M}: a named point; else right_molar, or the only one.

        Raises: InputError: if the mechanism has no such point.
        """
        points = self.mechanism.platform.points
        name = name or self.default_load_point
        if name is None:
            raise InputError(
                "the load needs a point of the platform: choose one with --load-point (load_point)."
                + did_you_mean("", points)
            )
        if name not in points:
            raise InputError(f'the platform has no point "{name}".{did_you_mean(name, points)}')
        return np.array(points[name])

    def torques(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        outputs: Collection[str] = (),
        threads: int | None = None,
    ) -> tuple[Torques, np.ndarray]:
        """Efforts alone, as fast as the machine.

        Args:    as for `evaluate`; outputs: what is wanted besides, of contact, share, motion,
                 joint and condition: ask for less, pay for less; threads: at most so many.
        Returns: the efforts, and the status of the samples (N,), an index into `STATUS_NAMES`.
        Raises:  InputError: for an output that is none of these.
        """
        for name in outputs:
            if name not in (*OUTPUTS, CONDITION):
                raise InputError(f'no output "{name}".{did_you_mean(name, (*OUTPUTS, CONDITION))}')
        conditioned = CONDITION in outputs
        if conditioned:
            outputs = {*outputs, "motion"} - {CONDITION}
        result = self.kernel.solve(q, q1, q2, load, outputs, threads)
        status = np.where(result.reached, OK, UNREACHABLE).astype(np.int8)
        doubtful = np.flatnonzero(result.uncertain & result.reached)
        if doubtful.size:
            poses = result.poses.pose[doubtful] if result.poses is not None else None
            if poses is None:
                few = [a[doubtful] for a in (q, q1, q2, load)]
                again = self.kernel.solve(few[0], few[1], few[2], few[3], ("motion",)).poses
                assert again is not None
                poses = again.pose
            with np.errstate(invalid="ignore", divide="ignore"):
                ratio = self.posture(poses).singularity.ratio
                finite = np.isfinite(result.torque[doubtful]).all(axis=1)
            status[doubtful] = judge(result.reached[doubtful], ratio >= SINGULAR, finite)
        result.torque[status != OK] = np.nan
        if conditioned:
            assert result.poses is not None
            with np.errstate(invalid="ignore", divide="ignore"):
                condition = self.posture(result.poses.pose).singularity.condition
            result = replace(result, condition=condition)
        return result, status

    def evaluate(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        threads: int | None = None,
    ) -> Evaluation:
        """Inverse dynamics at samples of the independent coordinates, with all that follows.

        Args: q, q1, q2: (N, m) each, in the order of `independent` [m, rad; per s; per s^2].
              load: (N, 9): force [N] and moment [N m] in {S}, and the point they act at, in {M}.
              threads: at most so many; default: the processors at hand. Results do not depend
              on it.
        """
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            torques = self.kernel.solve(q, q1, q2, load, threads=threads)
            poses = torques.poses
            assert poses is not None
            posture = self.posture(poses.pose)
            status = judge(
                torques.reached,
                posture.singularity.ratio >= SINGULAR,
                np.isfinite(torques.torque).all(axis=1),
            )
        return Evaluation(poses, torques, posture, status)

    def posture(self, pose: np.ndarray) -> Posture:
        """Joint coordinates, contact points and singularity measures at poses X_EE, (N, 6)."""
        n, k = len(self.mechanism.chains), len(self.mechanism.contacts)
        count, m = len(pose), 6 - k
        outputs = evaluate(self._posture_function, pose)
        q_r, cos_gamma, J_A, J_A_scale, J_W, rod_length, M_J, reach, *places = outputs
        J_W = J_W.reshape(count, 6, n).transpose(0, 2, 1)
        M_J = M_J.reshape(count, m, 6).transpose(0, 2, 1)
        joint, beta, gamma = q_r.reshape(count, 3, n).transpose(1, 0, 2)
        angles = np.array([i >= 3 for i in indices(self.independent)])
        singularity = measure(
            J_A, J_A_scale, J_W @ M_J, rod_length, angles, self.characteristic_length
        )
        points, normals = (a.reshape(count, k, 3) for a in places)
        return Posture(joint, beta, gamma, cos_gamma, reach, points, normals, singularity)

    def solve(
        self,
        motion: Motion,
        load: Load | None = None,
        load_point: str | None = None,
        flag: bool = False,
        reactions: bool = False,
        threads: int | None = None,
    ) -> Solution:
        """Torques along a motion under a load.

        Args:   motion: what the platform does; load: what acts on it (none by default).
                load_point: platform point the load acts at; default: the load's own, else
                right_molar.
                flag: keep samples that cannot be computed, empty and with a status.
                reactions: forces and moments in every joint too.
                threads: at most so many; results do not depend on it.
        Raises: UnreachableError, SingularError: for such samples, unless `flag`.
                InputError: if motion or load do not fit the mechanism.
        """
        from .motion import Load
        from .results.assemble import assemble

        start = time.perf_counter()
        load = load or Load.zero()
        wrench = load.at(motion.t)
        name = load_point or load.point
        loaded = np.any(wrench) or name is not None
        point = self.load_point(name) if loaded else np.zeros(3)
        name = (name or self.default_load_point) if loaded else None
        with step("solving"):
            q, q1, q2, residual = self.independent_motion(motion)
            evaluation = self.evaluate(q, q1, q2, with_point(wrench, point), threads)
        if not flag:
            self.require_ok(evaluation, motion.t)
        seconds = time.perf_counter() - start
        solution = assemble(self, motion, load, wrench, name, evaluation, residual, seconds)
        if not reactions:
            return solution
        from .dynamics.reactions import reaction_variables
        from .dynamics.reactions import reactions as joint_reactions

        found = joint_reactions(self, evaluation)
        variables, coordinates = reaction_variables(self.mechanism, found)
        return solution.assign(variables).assign_coords(coordinates)

    def independent_motion(
        self, motion: Motion
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, float | None]:
        """q_EE and its rates, (N, m) each, from a motion of any kind.

        Also returns the largest distance of a given whole pose from the contacts [m], which the
        projection removes; None for other kinds.
        """
        if motion.kind == "pose":
            columns = indices(self.independent)
            residual = self.contact_residual(motion.value)
            values = (motion.value, motion.rate, motion.acceleration)
            q, q1, q2 = (a[:, columns] for a in values)
            return q, q1, q2, residual
        q, q1, q2 = self.independent_states(
            motion.names,
            motion.value,
            motion.rate,
            motion.acceleration,
            motion.t,
            motion.landmark if motion.kind == "landmark" else None,
        )
        return q, q1, q2, None

    def independent_states(
        self,
        names: Sequence[str],
        value: np.ndarray,
        rate: np.ndarray,
        acceleration: np.ndarray,
        t: np.ndarray | None = None,
        landmark: str | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q_EE and its rates from another set of coordinates or a landmark's displacement.

        Samples that the contacts cannot meet come back as NaN.
        """
        if landmark is None and sorted(names) == sorted(self.independent):
            order = [list(names).index(name) for name in self.independent]
            return value[:, order], rate[:, order], acceleration[:, order]
        if landmark is not None:
            closure: Closure = landmark_closure(self.mechanism, landmark)
            # The fourth condition prescribes zero: the midpoint of the contacts stays put.
            value, rate, acceleration = (
                np.column_stack([a, np.zeros(len(a))]) for a in (value, rate, acceleration)
            )
        else:
            ordered = sorted(names, key=COORDINATES.index)
            closure = coordinate_closure(self.mechanism, ordered)
            order = [list(names).index(name) for name in ordered]
            value, rate, acceleration = value[:, order], rate[:, order], acceleration[:, order]
        found = closure.solve(value, rate, acceleration)
        columns = indices(self.independent)
        q, q1, q2 = (a[:, columns] for a in (found.pose, found.rate, found.acceleration))
        return q, q1, q2

    def contact_residual(self, pose: np.ndarray) -> float:
        """Largest |phi| of the contacts over poses, (N, 6) [m]."""
        import casadi as ca

        from .kinematics.closure import contact_symbols
        from .kinematics.contact import residuals

        if not self.mechanism.contacts:
            return 0.0
        x = ca.SX.sym("x", 6)
        phi = ca.Function("phi", [x], [residuals(contact_symbols(self.mechanism), x)])
        return float(np.nanmax(np.abs(evaluate(phi, pose)[0])))

    def require_ok(
        self, evaluation: Evaluation, t: np.ndarray | None = None, row_offset: int = 0
    ) -> None:
        """Raise for samples that could not be computed, naming the first and its cause.

        Args: t: their times; without, they are rows of a file that start at `row_offset`.
        """
        poses, posture = evaluation.poses, evaluation.posture
        error = sample_error(
            self.mechanism,
            evaluation.status,
            np.where(poses.reached[:, None], poses.pose, np.nan),
            posture.reach,
            posture.singularity,
            t,
            row_offset,
        )
        if error is not None:
            raise error

    def unreachable_cause(self, evaluation: Evaluation, sample: int) -> str:
        """Which chain or contact cannot be where the sample wants it."""
        poses, posture = evaluation.poses, evaluation.posture
        pose = np.where(poses.reached[:, None], poses.pose, np.nan)
        cause = causes(evaluation.status, pose, posture.reach, posture.singularity)[sample]
        return unreachable_text(self.mechanism, owners(self.mechanism)[cause], pose[sample])


def derive(
    mechanism: Mechanism,
    formulation: str = "virtual_power",
    route: str = "core",
    backend: str = "auto",
) -> Model:
    """Derive the equations of motion of a mechanism; see `Model`."""
    return Model(mechanism, formulation, route, backend)


def choose_kernel(
    mechanism: Mechanism, formulation: str, route: str, backend: str
) -> Interpreted | Compiled:
    """The kernel of a backend; `CONDYLE_BACKEND` decides what auto means, if it is set.

    Raises: InputError:    for an unknown backend.
            CompilerError: if compiled is asked for and there is no compiler.
    """
    from .backends.compiler import REMEDY, CompilerError
    from .backends.notice import notice
    from .kernels.compiled import Compiled
    from .kernels.interpreted import Interpreted

    chosen = os.environ.get("CONDYLE_BACKEND") or "auto" if backend == "auto" else backend
    if chosen not in BACKENDS:
        raise InputError(f'no backend "{chosen}".{did_you_mean(chosen, BACKENDS)}')
    if chosen != "interpreted":
        try:
            return Compiled(mechanism, formulation, route, required=chosen == "compiled")
        except CompilerError as error:
            if chosen == "compiled":
                raise CompilerError(f"{error}. {REMEDY}") from None
            notice(f"{error}; the interpreter gives the same numbers, slower", "compiler")
    return Interpreted(mechanism, formulation_named(formulation), route)


def check_home(mechanism: Mechanism) -> None:
    """Raises MechanismError where the contacts cannot hold the platform at home."""
    problems = [
        f'contact "{contact.name}": {problem}'
        for contact in mechanism.contacts
        if (problem := home_problem(contact)) is not None
    ]
    problems += [] if problems else list(holding_problems(mechanism))
    if problems:
        raise MechanismError(mechanism.name, problems)


def with_point(wrench: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Wrenches (N, 6) and the point they act at, (3,), as loads (N, 9)."""
    return np.hstack([wrench, np.broadcast_to(point, (len(wrench), 3))])
