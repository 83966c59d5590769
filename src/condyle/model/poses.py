"""What a pose is like: configuration, singularity, matrices of the equations of motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError, did_you_mean
from ..kinematics.constraints import closed_form_available, indices
from ..kinematics.free_motion import FreeMotion
from ..kinematics.singularities import Singularity, length_sensitivity
from ..questions.bound import bound
from ..questions.configuration import SETS, SURVEYED
from ..status import Status
from .arguments import POSE, Arguments, Lead, requested, samples
from .closing import Closure
from .model_result import ModelResult
from .surveying import Survey, judged
from .system import System
from .yielding import Place, place_by_coordinates

if TYPE_CHECKING:
    from ..motion import Motion

Array = np.ndarray
Space = Literal["q", "X"]
States = tuple[Array, Array, Array]


class Poses:
    """Questions about poses, none of which is about efforts; see `Model`."""

    def __init__(self, system: System, arguments: Arguments) -> None:
        self._system, self._arguments = system, arguments

    def configuration(self, pose: Any, threads: int | None = None) -> ModelResult:
        """Joints, contact points and singularity at whole poses X_EE, (..., 6), on the contacts."""
        lead, (pose,) = samples((POSE,), (POSE.array(pose),))
        inputs = {"pose": pose, **self._system.labels(len(pose))}
        answer = self._system.kernel("configuration").run(inputs, threads)
        answer.mend(inputs, lambda rows: (self._system.robust.configuration(rows), 0))
        return configured(answer.values, self._system.lengths(inputs)).shaped(lead)

    def inverse_kinematics(self, q: Any, v: Any, a: Any) -> ModelResult:
        """As `Model.inverse_kinematics`."""
        lead, (q, v_, a_) = self._states(q, v, a)
        poses, reached = self.platform_motion(q, v_, a_)
        at = self.configuration(poses["pose"])
        reached &= (at.discriminant >= 0).all(axis=1)
        results = {"pose": poses["pose"], **vars(at), "condition": at.singularity.condition}
        if v is not None or a is not None:
            results["pose_rate"] = poses["pose_rate"]
            if a is not None:
                results["pose_acceleration"] = poses["pose_acceleration"]
            still = dict.fromkeys(("force", "moment", "point"), np.zeros((1, 3)))
            joints = self._system.kernel("system").run(poses | still).values
            names = ("joint_rate", "joint_acceleration")[: 1 if a is None else 2]
            results |= {name: joints[name].T for name in names}
        results["bound"] = np.where(reached, at.bound, np.nan)
        status = np.where(reached, Status.ok, Status.unreachable).astype(np.uint8)
        self._system.mark_overlaps(status, poses["pose"], self._system.labels(len(status)))
        return ModelResult(**results, status=status).shaped(lead)

    def _states(self, *given: Any) -> tuple[Lead, list[Array]]:
        """q, v and a, (N, m) each; zero for None."""
        own = self._arguments
        arguments = (own.q, own.v, own.a)
        still = np.zeros(own.q.size)
        arrays = [
            still if x is None and i else argument.array(x)
            for i, (argument, x) in enumerate(zip(arguments, given, strict=True))
        ]
        lead, flat = samples(arguments, arrays)
        shape = (max(map(len, flat)), own.q.size) if 0 not in lead else flat[0].shape
        return lead, [np.broadcast_to(x, shape) for x in flat]

    def survey(self, q: Array, wanted: Collection[str] = (), threads: int | None = None) -> Survey:
        """What poses are like, each judged, as fast as the machine: for maps.

        Args:    q: (N, m), in the order of `independent`.  wanted: of `SURVEYED`: pose, joint,
                 transmission, rates (of the joints on v, lanes last but one), rows (of the
                 dimensionless J_W), ratio, points (of the contacts).
        Raises:  InputError: for an unknown name.
        """
        requested(wanted, SURVEYED)
        system = self._system
        q = self._states(q, None, None)[1][0]
        extra = ["pose"] if system.may_overlap else []
        own, spare = SETS.covering(frozenset([*wanted, *extra]))
        answer = system.kernel("survey", own).run({"q": q}, threads, spare)

        # Contacts that are closed in a fixed number of steps, which may be too few.
        forms = [form for form, _ in system.structure.contacts]
        iterated = not closed_form_available(forms, system.dependent)
        result = judged(answer, q, iterated, lambda few: system.robust.survey(own, few))
        if extra:
            system.mark_overlaps(result.status, result.values["pose"].T, system.labels(len(q)))
            for value in result.values.values():
                value[..., result.status == Status.overlap] = np.nan
        return result

    def matrix(self, name: str, q: Any, v: Any, space: Space) -> Array:
        """One of the results of the question `matrices`."""
        _require_space(space)
        lead, values = self._at("matrices", q, v)
        found = np.moveaxis(values[name if space == "q" else f"{name}_X"], -1, 0)
        return found.reshape((*lead, *found.shape[1:]))

    def coriolis(self, q: Any, v: Any, space: Space) -> Array:
        """As `Model.coriolis`."""
        _require_space(space)
        lead, inputs = self._inputs(q, v)
        ports = {name: inputs[name] for name in ("pose", "pose_rate")}
        found = np.moveaxis(self._system.robust.coriolis(space == "X", ports), -1, 0)
        return found.reshape((*lead, *found.shape[1:]))

    def jacobians(self, q: Any) -> ModelResult:
        """As `Model.jacobians`."""
        lead, values = self._at("jacobians", q, None)
        result = {name: values[name].transpose(2, 1, 0) for name in ("J", "J_theta")}
        result |= {name: np.moveaxis(values[name], -1, 0) for name in ("M_J", "twist_basis")}
        result["length_sensitivity"] = _length_sensitivity(values)
        for name in ("M_1", "M_2", "M_3"):
            result[name] = values[name].transpose(3, 2, 0, 1)
        return ModelResult(**result).shaped(lead)

    def length_sensitivity(self, pose: Array) -> Array:
        """d log ratio / d log L of the singularity ratio, (N,), at whole poses, (N, 6)."""
        return _length_sensitivity(self._system.kernel("jacobians").run({"pose": pose}).values)

    def free_motion(self, pose: Array) -> FreeMotion:
        """What the platform can do at a direct singularity while all actuators are locked, at one
        whole pose, (6,)."""
        values = self._system.kernel("jacobians").run({"pose": pose[None]}).values
        J_W, N = values["J_W"][..., 0].T, values["N"][..., 0]
        return FreeMotion.of(J_W, N, self._system.length)

    def free_motion_text(self, pose: Array) -> str:
        """The same as a screw in words."""
        mechanism = self._system.mechanism
        R = Rotation.from_euler("XYZ", pose[3:]).as_matrix()
        points = {one.name: R @ one.point for one in mechanism.contacts}
        points |= {name: R @ point for name, point in mechanism.platform.points.items()}
        return self.free_motion(pose).text(points)

    def _at(self, question: str, q: Any, v: Any) -> tuple[Lead, dict[str, Array]]:
        """Results of a question on the platform's motion, at whole poses the contacts meet."""
        lead, poses = self._inputs(q, v)
        kernel = self._system.kernel(question)
        inputs = {port.name: poses[port.name] for port in kernel.interface.ports}
        return lead, kernel.run(inputs).values

    def _inputs(self, q: Any, v: Any) -> tuple[Lead, dict[str, Array]]:
        lead, (q, v, a) = self._states(q, v, None)
        poses, reached = self.platform_motion(q, v, a)
        if not reached.all():
            sample = int(np.argmin(reached))
            raise InputError(f"the contacts cannot be met at sample {sample}: q = {q[sample]}")
        return lead, poses

    def platform_motion(self, q: Array, q1: Array, q2: Array) -> tuple[dict[str, Array], Array]:
        """X_EE and its rates, (N, 6) each, and where the contacts can be met."""
        inputs = {"q": q, "q1": q1, "q2": q2}
        answer = self._system.kernel("motion").run(inputs)
        answer.mend(inputs, lambda rows: self._system.robust.motion(rows))
        return {name: a.T for name, a in answer.values.items()}, answer.status == Status.ok

    def of_motion(self, motion: Motion) -> tuple[States, float | None]:
        """q_EE and its rates, (N, m) each, from a motion of any kind.

        Also returns the largest distance of a given whole pose from the contacts [m], which the
        projection removes; None for other kinds.
        """
        given = (motion.value, motion.rate, motion.acceleration)
        if motion.kind == "pose":
            columns = indices(self._system.independent)
            q, q1, q2 = (a[:, columns] for a in given)
            return (q, q1, q2), self.contact_residual(motion.value)
        return self.states(motion.names, given, self._landmark(motion)), None

    def contact_residual(self, pose: Array) -> float:
        """Largest |phi| of the contacts over poses, (N, 6) [m]."""
        if not self._system.mechanism.contacts:
            return 0.0
        phi = self._system.kernel("encoders").run({"pose": pose}).values["phi"]
        return float(np.nanmax(np.abs(phi)))

    def states(
        self,
        names: Collection[str],
        given: States,
        landmark: str | None = None,
        threads: int | None = None,
    ) -> States:
        """q_EE and its rates from another set of coordinates or a landmark's displacement.

        Samples that the contacts cannot meet come back as NaN.
        """
        names, independent = list(names), self._system.independent
        if landmark is None and sorted(names) == sorted(independent):
            return given if tuple(names) == independent else _ordered(given, names, independent)
        closure, given = self._closure(names, given, landmark)
        found = closure.solve(*given, threads)
        columns = indices(independent)
        q, q1, q2 = (a[:, columns] for a in (found.pose, found.rate, found.acceleration))
        return q, q1, q2

    def placing(self, motion: Motion) -> Place | None:
        """How poses follow from a motion where contacts yield; None where it gives q."""
        names = list(motion.names)
        if motion.kind == "pose" or sorted(names) == sorted(self._system.independent):
            return None
        given = motion.value, motion.rate, motion.acceleration
        closure, given = self._closure(names, given, self._landmark(motion))
        return place_by_coordinates(closure.followed, *given)

    def _landmark(self, motion: Motion) -> str | None:
        """The landmark whose path a motion gives, if it does."""
        if motion.kind != "landmark":
            return None
        from ..motion import resolve_landmark  # files and splines: most models need none

        return resolve_landmark(motion.landmark, self._system.mechanism.platform.points)

    def _closure(
        self, names: list[str], given: States, landmark: str | None
    ) -> tuple[Closure, States]:
        """What closes the contacts for a motion, and the motion in its order."""
        closure = self._system.closure(tuple(names), landmark)
        if landmark is None:
            return closure, _ordered(given, names, closure.names)
        # The fourth condition prescribes zero: the midpoint of the contacts stays put.
        s, s1, s2 = (np.column_stack([a, np.zeros(len(a))]) for a in given)
        return closure, (s, s1, s2)


def _require_space(space: Space) -> None:
    if space not in (known := get_args(Space)):
        hint = did_you_mean(str(space), known)
        raise InputError(f'space: unknown space "{space!s:.60}".{hint}')


def _length_sensitivity(values: Mapping[str, Array]) -> Array:
    J_W, N = values["J_W"].transpose(2, 1, 0), values["N"].transpose(2, 0, 1)
    return length_sensitivity(J_W, N, values["transmission"].T)


def _ordered(given: States, names: list[str], wanted: Collection[str]) -> States:
    order = [names.index(name) for name in wanted]
    q, q1, q2 = (a[:, order] for a in given)
    return q, q1, q2


CONFIGURATION = ("joint", "beta", "gamma", "cos_gamma", "discriminant")


def configured(values: Mapping[str, Array], length: Any) -> ModelResult:
    """Results of a kernel, samples last, as a configuration; length: the characteristic one [m]."""
    result = {name: values[name].T for name in CONFIGURATION}
    for name in ("contact_point", "contact_normal"):
        result[name] = np.moveaxis(values[name], -1, 0)
    if "data_error" in values:
        result["bound"] = bound(values["data_error"])
    return ModelResult(**result, singularity=singularity(values, length))


def singularity(values: Mapping[str, Array], length: Any) -> Singularity:
    """Its singularity measures alone."""
    J_A, transmission, sigma = (values[name].T for name in ("J_A", "transmission", "J_W_sigma"))
    return Singularity.of(J_A, transmission, sigma, values["J_A_extremes"], length)
