"""A mechanism, a formulation and a route, ready to compute: numbers in, numbers out.

Every question is run by a kernel of the backend; samples that it cannot vouch for go the robust
path. `condyle.derive` returns one that also labels what it finds, `condyle.results.model.Model`.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np

from ..backends.c.kernel import CompiledKernel
from ..backends.choose import Backend
from ..backends.kernel import AGAIN, Kernel
from ..distribution import OBJECTIVES
from ..dynamics import ROUTES
from ..dynamics import formulation as formulation_named
from ..errors import InputError, MechanismError, did_you_mean
from ..kinematics.contact import closed_form_available, indices
from ..kinematics.singularity import Singularity
from ..mechanism.home import (
    characteristic_length,
    dependent_coordinates,
    holding_problems,
    home_problem,
    independent_coordinates,
)
from ..mechanism.mechanism import Mechanism
from ..motion import Motion, resolve_landmark, resolve_load_point
from ..progress import step
from ..questions import Prescribed, Question
from ..questions.equations import INTERNAL, part_names
from ..questions.inverse import OUTPUTS
from ..questions.numbers import Layout, require_closed_form, specialised
from ..questions.structure import structure_of
from ..status import Status
from .accelerating import Accelerator
from .checks import (
    LOAD,
    LOAD_COLUMNS,
    POSE_COLUMNS,
    Sample,
    as_samples,
    check_array,
    check_states,
    samples_of_states,
)
from .closing import Closure
from .data import Accelerations, Configuration, Efforts, Evaluation
from .distributing import LEAST, Distributor, Policy
from .one import OneByOne
from .reference_force import reference_force
from .robust import Robust
from .survey import SURVEYED, Survey, judged

CONDITION = "condition"
DEFAULT = (None, 0.0, 0.0)  # distribution, preload and contact weight
EVERYTHING = ("contact", "share", "motion", "joint", "configuration")
# Names of results, by what is asked for.
RESULTS = {
    "contact": ("contact_force",),
    "share": ("share",),
    "gravity": ("gravity",),
    "motion": ("pose", "pose_rate", "pose_acceleration"),
    "joint": ("joint_rate", "joint_acceleration"),
}

States = tuple[np.ndarray, np.ndarray, np.ndarray]


class Evaluator:
    """Inverse dynamics of a mechanism by one formulation and route, and what belongs to it."""

    def __init__(
        self,
        mechanism: Mechanism,
        formulation: str = "virtual_power",
        route: str = "core",
        backend: str = "auto",
        distribution: str | None = None,
        preload: float = 0.0,
        contact_weight: float = 0.0,
        general: bool = False,
    ) -> None:
        """Derive the equations of motion.

        Args:   distribution: how efforts are chosen, of `condyle.distribution.OBJECTIVES`; default:
                bounded with cables, else minimum_norm.
                preload: least push of one-sided contacts [N].
                contact_weight: W / N_ref^2 of `weighted` [1/N^2].
                backend: compiled, numpy, or auto (compiled where there is a C compiler).
                general: for `renumbered`: kernels that serve every mechanism of the structure,
                by leaving out nothing that happens to be zero in this one.
        Raises: InputError:       for an unknown formulation, route or backend.
                UnsupportedError: where route `direct` has no closed form.
                MechanismError:   if the contacts do not hold the platform at home.
                CompilerError:    if compiled is asked for and there is no compiler.
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
        self._asked = distribution, preload, contact_weight
        if self._asked != DEFAULT:
            _ = self.policy  # what is asked for has to fit, now
        self.backend = Backend(backend)
        with step("deriving the equations"):
            structure = structure_of(mechanism, self.formulation, route)
            self._numbers = Layout.of(structure).numbers(mechanism)
            self._structure = structure if general else specialised(structure, self._numbers)
        self._general: Any = self if general else None  # who lends kernels
        self._kernels: dict[Any, Kernel] = {}
        self._closures: dict[Any, Closure] = {}
        self.derivation_seconds = time.perf_counter() - start

    def __repr__(self) -> str:
        return (
            f'Model of "{self.mechanism.name}": {self.formulation}, route {self.route}, '
            f"{self.backend.name}\n"
            f"  {len(self.mechanism.chains)} efforts from q = ({', '.join(self.independent)})"
        )

    def __copy__(self) -> Self:
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        """Models travel as their recipe; kernels are found again in the cache."""
        return type(self), (
            self.mechanism,
            self.formulation,
            self.route,
            self.backend.asked,
            *self._asked,
            *((True,) if self._general is not None else ()),
        )

    # -- what it is ------------------------------------------------------------------------

    @cached_property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent coordinates q_EE, in order."""
        return independent_coordinates(self.mechanism)

    @cached_property
    def dependent(self) -> tuple[str, ...]:
        """Names of the coordinates that the contacts determine."""
        return dependent_coordinates(self.mechanism)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts that share the efforts."""
        internal = not self._distributor.least_norm and not self._structure.friction
        return part_names(self._structure) + (INTERNAL,) * internal

    @property
    def limited(self) -> bool:
        """Whether efforts are chosen within limits."""
        return OBJECTIVES[self.policy.objective].limits

    @property
    def chooses_efforts(self) -> bool:
        """Whether efforts may be others than those of least norm."""
        return self._distributor.chooses

    @cached_property
    def reference_force(self) -> float:
        """N_ref, by which `weighted` measures contact forces [N]."""
        return reference_force(self.mechanism)

    def choosing(
        self, distribution: str | None = None, preload: float = 0.0, contact_weight: float = 0.0
    ) -> Self:
        """The same model, kernels and all, that chooses efforts otherwise; see `derive`."""
        other = copy(self)
        for name in ("policy", "_distributor", "_one_by_one"):
            other.__dict__.pop(name, None)
        other._asked = distribution, preload, contact_weight
        _ = other.policy  # has to fit, now
        return other

    def renumbered(self, mechanism: Mechanism) -> Self:
        """The same model, if it is general, of another mechanism of the same structure.

        It shares the kernels, so that it costs a thousandth of a new one. The mechanism must have
        been checked, as one from a file or from `Mechanism.set` is.

        Raises: InputError: if the distribution does not fit the mechanism.
        """
        assert self._general is not None
        other = copy(self._general)
        for name in _cached_by(type(self)):
            other.__dict__.pop(name, None)
        other.mechanism = mechanism
        _ = other.policy  # has to fit, now
        other._numbers = Layout.of(self._structure).numbers(mechanism)
        other._kernels, other._closures = {}, {}
        return other

    @cached_property
    def policy(self) -> Policy:
        """How efforts are chosen; forward dynamics has no need of it.

        Raises: InputError: where the default does not fit the mechanism.
        """
        return Policy.of(self.mechanism, *self._asked)

    @cached_property
    def _distributor(self) -> Distributor:
        return Distributor(self.mechanism, self.policy, self.backend)

    @cached_property
    def characteristic_length(self) -> float:
        """What angles are multiplied by where they meet lengths [m]."""
        return characteristic_length(self.mechanism)

    def kernel(self, question: str, *details: Any) -> Kernel:
        """The kernel of a question; see `condyle.questions`."""
        asked = question, details
        if asked not in self._kernels and self._general not in (None, self):
            shared = self._general.kernel(question, *details)
            self._kernels[asked] = shared.renumbered(self._numbers)
        if asked not in self._kernels:
            structure = self._structure
            if question == "inverse" and self._distributor.unsolved_friction:
                structure = replace(structure, friction=())
            q = Question.about(structure, question, *details)
            self._kernels[asked] = self.backend.kernel(q.key, q.variants, self._numbers)
        return self._kernels[asked]

    @cached_property
    def _robust(self) -> Robust:
        distributor = Distributor(self.mechanism, Policy(LEAST))
        return Robust(self._structure, self._numbers, self.independent, distributor)

    # -- inverse dynamics ------------------------------------------------------------------

    def torques(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        outputs: Collection[str] = (),
        threads: int | None = None,
    ) -> Efforts:
        """Efforts alone, as fast as the machine.

        Args:    as for `evaluate`; outputs: what is wanted besides, of contact, share, gravity
                 (what of each share gravity and load alone ask for), motion, joint and condition:
                 ask for less, pay for less; threads: at most so many.
        Raises:  InputError: for an output that is none of these.
        """
        known = (*RESULTS, CONDITION)
        for name in outputs:
            if name not in known:
                raise InputError(f'no output "{name}".{did_you_mean(name, known)}')
        wanted = {*outputs} - {CONDITION}
        if CONDITION in outputs:
            wanted.add("configuration")
        values, status = self._solve(q, q1, q2, load, wanted, threads)
        effort = values["effort"].T
        if status.any():
            effort[status != Status.ok] = np.nan
        others = {
            name: _sample_first(name, values[name])
            for output in outputs
            for name in RESULTS.get(output, ())
        }
        if CONDITION in outputs:
            others[CONDITION] = self._singularity(values).condition
        return Efforts(effort, others, status)

    def one(self, q: np.ndarray, q1: np.ndarray, q2: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Efforts of one sample, (n,) [N m or N], at least latency: for a control loop.

        Args: q, q1, q2: (m,) each, in the order of `independent`;  load: (9,), as of `evaluate`.
              Arrays of doubles go fastest.
        Returns: efforts in the order of the chains, a new array; NaN where there are none.
        Raises:  InputError: for arrays that do not fit.
        """
        if (quick := self._one_by_one) is not None:
            found = quick.call(q, q1, q2, load)
            if found is not None:
                return found
        rows = [a[None] for a in as_samples(self._samples, q, q1, q2, load)]
        return self.torques(rows[0], rows[1], rows[2], rows[3]).effort[0]

    @cached_property
    def _one_by_one(self) -> OneByOne | None:
        """What `one` calls; None where a kernel alone cannot say what the efforts are."""
        kernel = self.kernel("inverse", ())
        if self._distributor.chooses or not isinstance(kernel, CompiledKernel):
            return None
        return OneByOne(kernel, self._samples, np.argsort(kernel.order))

    @cached_property
    def _samples(self) -> tuple[Sample, ...]:
        return (*samples_of_states(self.independent), LOAD)

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
        values, status = self._solve(q, q1, q2, load, EVERYTHING, threads)
        return Evaluation(
            **{name: _sample_first(name, values[name]) for name in ("effort", *_names(EVERYTHING))},
            configuration=self._configured(values),
            status=status,
            shortfall=values.get("shortfall", np.where(status == Status.ok, 1.0, np.nan)),
            **self._rubbed(values),
        )

    def _rubbed(self, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Sliding velocity and friction force at the contacts, (N, k, 3) each."""
        force = values["contact_force"]
        if "slip" not in values:
            # Of friction that no kernel goes through the sliding is not known.
            known = not self._structure.friction
            none = np.full((force.shape[1], force.shape[0], 3), 0.0 if known else np.nan)
            return {"slip": none, "friction_force": none}
        drag = np.moveaxis(values["drag"], -1, 0)
        return {
            "slip": np.moveaxis(values["slip"], -1, 0),
            "friction_force": -np.abs(force.T)[..., None] * drag,
        }

    def _solve(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        wanted: Collection[str],
        threads: int | None,
    ) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Results by name, samples last, and their statuses."""
        choosing = self._distributor.chooses
        if choosing:
            wanted = {*wanted, "contact", "motion"}
        kernel = self.kernel("inverse", tuple(o for o in OUTPUTS if o in wanted))
        check_array("load", load, 9, LOAD_COLUMNS)
        load = np.asarray(load)
        wrench = {"force": load[:, :3], "moment": load[:, 3:6], "point": load[:, 6:]}
        inputs = {"q": q, "q1": q1, "q2": q2, **wrench}
        check_states(self.independent, q, q1, q2)
        answer = kernel.run(inputs, threads)
        if self._distributor.unsolved_friction:
            self._make_room(answer.values)
        again = np.flatnonzero(answer.status == AGAIN)
        if again.size:
            few = {name: np.asarray(a, dtype=float)[again] for name, a in inputs.items()}
            better, answer.status[again] = self._robust.evaluate(few)
            for name, value in answer.values.items():
                value[..., again] = better[name]
        if choosing:
            self._choose(answer.values, answer.status, inputs)
        return answer.values, answer.status

    def _make_room(self, values: dict[str, np.ndarray]) -> None:
        """For what friction adds to the results of a kernel that does not know of it, in place."""
        _add_parts(values, 2)
        if "contact_force" in values:
            k, N = values["contact_force"].shape
            values["slip"], values["drag"] = np.zeros((2, k, 3, N))

    def _choose(
        self,
        values: dict[str, np.ndarray],
        status: np.ndarray,
        inputs: Mapping[str, np.ndarray],
    ) -> None:
        """Replace what the least norm does not serve, in place, by what the policy asks for."""
        values["shortfall"] = np.where(status == Status.ok, 1.0, np.nan)
        if not self._structure.friction:
            _add_parts(values, 1)
        rows = self._distributor.rows(values, status)
        if not rows.size:
            return
        ports = {name: values[name].T[rows] for name in RESULTS["motion"]}
        ports |= {name: inputs[name][rows] for name in ("force", "moment", "point")}
        # Shares cost more than all the rest.
        question = "system" if {"share", "slip"} & values.keys() else "balance"
        better = self._distributor.solve(self.kernel(question).run(ports).values)
        status[rows] = better.pop("status")
        for name, value in better.items():
            if name in values:
                values[name][..., rows] = value

    # -- forward dynamics ------------------------------------------------------------------

    @cached_property
    def _accelerator(self) -> Accelerator:
        return Accelerator(self.mechanism, self.kernel, lambda: self._robust)

    def forward(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        effort: np.ndarray,
        load: np.ndarray,
        outputs: Collection[str] = (),
        threads: int | None = None,
    ) -> Accelerations:
        """Forward dynamics: the accelerations that efforts and loads make.

        Limits of efforts, and that cables cannot push, are the caller's concern.

        Args:    q, q1: (N, m) each, in the order of `independent` [m, rad; per s].
                 effort: (N, n) [N m or N], in the order of the chains.
                 load: (N, 9), as of `evaluate`.
                 outputs: what is wanted besides, of motion, joint and sliding; threads: at most so
                 many.
        Raises:  InputError: for an output that is none of these, or arrays that do not fit.
        """
        return self._accelerator(q, q1, effort, load, outputs, threads)

    def forward_one(
        self, q: np.ndarray, q1: np.ndarray, effort: np.ndarray, load: np.ndarray
    ) -> np.ndarray:
        """Accelerations of one sample, (m,), at least latency; NaN where there are none.

        Args: q, q1: (m,) each;  effort: (n,);  load: (9,); as of `forward`. Arrays of doubles go
              fastest.
        Returns: a new array.
        Raises:  InputError: for arrays that do not fit.
        """
        return self._accelerator.one(q, q1, effort, load)

    def linearised(
        self, q: np.ndarray, q1: np.ndarray, effort: np.ndarray, load: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """x' = A x + B effort about states x = (q, q'), exact; arguments as of `forward`.

        The load stays as it is in {S}. Returns: A, (N, 2 m, 2 m), and B, (N, 2 m, n); NaN where
        there are no accelerations.
        """
        return self._accelerator.linearised(q, q1, effort, load)

    # -- the configuration -----------------------------------------------------------------

    def configuration(self, pose: np.ndarray, threads: int | None = None) -> Configuration:
        """Joint coordinates, contact points and singularity measures at poses X_EE, (N, 6)."""
        check_array("pose", pose, 6, POSE_COLUMNS)
        answer = self.kernel("configuration").run({"pose": pose}, threads)
        again = np.flatnonzero(answer.status == AGAIN)
        if again.size:
            better = self._robust.configuration(np.asarray(pose, dtype=float)[again])
            for name, value in answer.values.items():
                value[..., again] = better[name]
        return self._configured(answer.values)

    def _configured(self, values: Mapping[str, np.ndarray]) -> Configuration:
        joint, beta, gamma, cos_gamma, discriminant = (
            values[name].T for name in ("joint", "beta", "gamma", "cos_gamma", "discriminant")
        )
        points, normals = (
            np.moveaxis(values[name], -1, 0) for name in ("contact_point", "contact_normal")
        )
        return Configuration(
            joint,
            beta,
            gamma,
            cos_gamma,
            discriminant,
            points,
            normals,
            self._singularity(values),
        )

    def _singularity(self, values: Mapping[str, np.ndarray]) -> Singularity:
        J_A, transmission, sigma = (values[name].T for name in ("J_A", "transmission", "J_W_sigma"))
        extremes = values["J_A_extremes"]
        return Singularity.of(J_A, transmission, sigma, extremes, self.characteristic_length)

    def survey(
        self, q: np.ndarray, wanted: Collection[str] = (), threads: int | None = None
    ) -> Survey:
        """What poses are like, each judged, as fast as the machine: for maps.

        Args:    q: (N, m), in the order of `independent`.  wanted: of `SURVEYED`: pose, joint,
                 transmission, rates (of the joints on q', lanes last but one), rows (of the
                 dimensionless J_W), ratio, points (of the contacts).
        Raises:  InputError: for a name that is none of these.
        """
        for name in wanted:
            if name not in SURVEYED:
                raise InputError(f'no output "{name}".{did_you_mean(name, SURVEYED)}')
        check_states(self.independent, q)
        wanted = tuple(name for name in SURVEYED if name in wanted)
        answer = self.kernel("survey", wanted).run({"q": q}, threads)

        def follow(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            some = np.asarray(q, dtype=float)[rows]
            poses, reached = self._robust.motion(some, 0 * some, 0 * some)
            return poses["pose"], reached

        at_poses = partial(self._robust.survey, wanted)
        return judged(answer, self._iterated, follow, at_poses)

    @cached_property
    def _iterated(self) -> bool:
        """Whether contacts are closed in a fixed number of steps, which may be too few."""
        forms = [form for form, _ in self._structure.contacts]
        return not closed_form_available(forms, self._structure.dependent)

    # -- the matrices of the equations of motion ---------------------------------------------

    def inertia_matrix(self, q: np.ndarray, space: str = "q") -> np.ndarray:
        """M_r of [Cheng2023] eqs (57), (63): (N, m, m) in q_EE.

        Args: q: (N, m), in the order of `independent`.
              space: "X" for the mechanism without contacts, dual to X_EE, (N, 6, 6): eqs (61),
              (64).
        Raises: InputError: for another space, or a pose that cannot be reached.
        """
        return self._matrices(q, np.zeros_like(q), "inertia_matrix", space)

    def bias(self, q: np.ndarray, q1: np.ndarray, space: str = "q") -> np.ndarray:
        """C_r q', (N, m) [N, N m]: Coriolis and centrifugal forces; in `space` "X", (N, 6)."""
        return self._matrices(q, q1, "bias", space)

    def gravity(self, q: np.ndarray, space: str = "q") -> np.ndarray:
        """G_r, (N, m) [N, N m]: what holds it against gravity; in `space` "X", (N, 6)."""
        return self._matrices(q, np.zeros_like(q), "gravity", space)

    def _matrices(self, q: np.ndarray, q1: np.ndarray, name: str, space: str) -> np.ndarray:
        if space not in ("q", "X"):
            raise InputError(f'no space "{space}".{did_you_mean(space, ("q", "X"))}')
        check_states(self.independent, q, q1)
        values = self._at("matrices", q, q1)
        return np.moveaxis(values[name if space == "q" else f"{name}_X"], -1, 0)

    def jacobians(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Jacobians of [Cheng2023] eqs (9), (15)-(18) at samples (N, m).

        Returns: J_theta (N, n, 6): theta' = J_theta X_EE'; M_J (N, 6, m); M_1 (N, n, 3, 3), M_2 and
                 M_3 (N, n, 3, 6): M_1 q_r' = M_2 X_EE', q_r' = M_3 X_EE' of every chain.
        """
        check_states(self.independent, q)
        values = self._at("jacobians", q, np.zeros_like(q))
        found = {"J_theta": np.moveaxis(values["J_theta"], -1, 0).transpose(0, 2, 1)}
        found["M_J"] = np.moveaxis(values["M_J"], -1, 0)
        for name in ("M_1", "M_2", "M_3"):
            found[name] = values[name].transpose(3, 2, 0, 1)
        return found

    def _at(self, question: str, q: np.ndarray, q1: np.ndarray) -> dict[str, np.ndarray]:
        """Results of a question on the platform's motion, at whole poses the contacts meet."""
        poses, reached = self._poses(q, q1, np.zeros_like(q))
        if not reached.all():
            sample = int(np.argmin(reached))
            raise InputError(f"the contacts cannot be met at sample {sample}: q = {q[sample]}")
        names = [port.name for port in self.kernel(question).interface.ports]
        return self.kernel(question).run({name: poses[name] for name in names}).values

    def _poses(
        self, q: np.ndarray, q1: np.ndarray, q2: np.ndarray
    ) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """X_EE and its rates, (N, 6) each, and where the contacts can be met."""
        answer = self.kernel("motion").run({"q": q, "q1": q1, "q2": q2})
        poses = {name: a.T for name, a in answer.values.items()}
        reached = answer.status == Status.ok
        again = np.flatnonzero(answer.status == AGAIN)
        if again.size:
            better, reached[again] = self._robust.motion(q[again], q1[again], q2[again])
            for name, a in better.items():
                poses[name][again] = a
        return poses, reached

    # -- motions and loads -------------------------------------------------------------------

    def load_point(self, name: str | None) -> np.ndarray:
        """Where a load acts, (3,) [m] in {M}: a named point; else right_molar, or the only one.

        Raises: InputError: if the mechanism has no such point.
        """
        points = self.mechanism.platform.points
        return np.array(points[resolve_load_point(name, points)])

    def independent_motion(self, motion: Motion) -> tuple[States, float | None]:
        """q_EE and its rates, (N, m) each, from a motion of any kind.

        Also returns the largest distance of a given whole pose from the contacts [m], which the
        projection removes; None for other kinds.
        """
        given = (motion.value, motion.rate, motion.acceleration)
        if motion.kind == "pose":
            columns = indices(self.independent)
            q, q1, q2 = (a[:, columns] for a in given)
            return (q, q1, q2), self.contact_residual(motion.value)
        landmark = None
        if motion.kind == "landmark":
            landmark = resolve_landmark(motion.landmark, self.mechanism.platform.points)
        return self.independent_states(motion.names, *given, landmark), None

    def contact_residual(self, pose: np.ndarray) -> float:
        """Largest |phi| of the contacts over poses, (N, 6) [m]."""
        if not self.mechanism.contacts:
            return 0.0
        phi = self.kernel("encoders").run({"pose": pose}).values["phi"]
        return float(np.nanmax(np.abs(phi)))

    def independent_states(
        self,
        names: Sequence[str],
        value: np.ndarray,
        rate: np.ndarray,
        acceleration: np.ndarray,
        landmark: str | None = None,
        threads: int | None = None,
    ) -> States:
        """q_EE and its rates from another set of coordinates or a landmark's displacement.

        Samples that the contacts cannot meet come back as NaN.
        """
        given = (value, rate, acceleration)
        if landmark is None and sorted(names) == sorted(self.independent):
            if tuple(names) == self.independent:
                return given
            order = [list(names).index(name) for name in self.independent]
            q, q1, q2 = (a[:, order] for a in given)
            return q, q1, q2
        closure = self._closure(tuple(names), landmark)
        if landmark is None:
            order = [list(names).index(name) for name in closure.names]
            s, s1, s2 = (a[:, order] for a in given)
        else:
            # The fourth condition prescribes zero: the midpoint of the contacts stays put.
            s, s1, s2 = (np.column_stack([a, np.zeros(len(a))]) for a in given)
        found = closure.solve(s, s1, s2, threads)
        columns = indices(self.independent)
        q, q1, q2 = (a[:, columns] for a in (found.pose, found.rate, found.acceleration))
        return q, q1, q2

    def _closure(self, names: tuple[str, ...], landmark: str | None) -> Closure:
        key = ("closure", names, landmark)
        if key not in self._closures and self._general not in (None, self):
            shared = self._general._closure(names, landmark)
            self._closures[key] = shared.renumbered(self.mechanism)
        if key not in self._closures:
            general = self._general is not None
            self._closures[key] = Closure(self.mechanism, names, landmark, self.backend, general)
        return self._closures[key]


def _cached_by(kind: type) -> tuple[str, ...]:
    """What instances keep because it was asked for once."""
    kept = (vars(one).items() for one in kind.__mro__)
    return tuple(n for items in kept for n, v in items if isinstance(v, cached_property))


def _names(outputs: Collection[str]) -> list[str]:
    return [name for output in outputs for name in RESULTS.get(output, ())]


def _add_parts(values: dict[str, np.ndarray], count: int) -> None:
    """Parts more that ask for nothing, in place."""
    for name in {"share", "gravity"} & values.keys():
        zero = np.zeros((count, *values[name].shape[1:]))
        values[name] = np.concatenate([values[name], zero])


def _sample_first(name: str, value: np.ndarray) -> np.ndarray:
    """Samples last to samples first; of shares, after the parts."""
    return value.swapaxes(1, 2) if name in ("share", "gravity") else value.T


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


__all__ = ["Evaluator", "Prescribed", "check_home", "with_point"]
