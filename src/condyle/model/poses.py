"""What a pose is like: configuration, singularity, matrices of the equations of motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial

import numpy as np

from ..errors import InputError, did_you_mean
from ..kinematics.constraints import closed_form_available, indices
from ..kinematics.singularities import Singularity
from ..motion import Motion, resolve_landmark
from ..status import Status
from .checks import POSE_COLUMNS, check_array, check_states
from .data import Configuration
from .surveying import SURVEYED, Survey, judged
from .system import System, mended

Array = np.ndarray
States = tuple[Array, Array, Array]


class Poses:
    """Questions about poses, none of which is about efforts; see `Model`."""

    def __init__(self, system: System) -> None:
        self._system = system

    def configuration(self, pose: Array, threads: int | None) -> Configuration:
        """As `Model.configuration`."""
        check_array("pose", pose, 6, POSE_COLUMNS)
        inputs = {"pose": pose}
        answer = self._system.kernel("configuration").run(inputs, threads)
        mended(answer, inputs, lambda few: (self._system.robust.configuration(few["pose"]), 0))
        return configured(answer.values, self._system.length)

    def survey(self, q: Array, wanted: Collection[str], threads: int | None) -> Survey:
        """As `Model.survey`."""
        for name in wanted:
            if name not in SURVEYED:
                raise InputError(f'no output "{name}".{did_you_mean(name, SURVEYED)}')
        system = self._system
        check_states(system.independent, q)
        wanted = tuple(name for name in SURVEYED if name in wanted)
        answer = system.kernel("survey", wanted).run({"q": q}, threads)

        def follow(rows: Array) -> tuple[Array, Array]:
            some = np.asarray(q, dtype=float)[rows]
            values, status = system.robust.motion({"q": some, "q1": 0 * some, "q2": 0 * some})
            return values["pose"].T, status == Status.ok

        # Contacts that are closed in a fixed number of steps, which may be too few.
        forms = [form for form, _ in system.structure.contacts]
        iterated = not closed_form_available(forms, system.dependent)
        return judged(answer, iterated, follow, partial(system.robust.survey, wanted))

    def matrices(self, q: Array, q1: Array, name: str, space: str) -> Array:
        """One of the results of the question `matrices`, samples first."""
        if space not in ("q", "X"):
            raise InputError(f'no space "{space}".{did_you_mean(space, ("q", "X"))}')
        check_states(self._system.independent, q, q1)
        values = self._at("matrices", q, q1)
        return np.moveaxis(values[name if space == "q" else f"{name}_X"], -1, 0)

    def jacobians(self, q: Array) -> dict[str, Array]:
        """As `Model.jacobians`."""
        check_states(self._system.independent, q)
        values = self._at("jacobians", q, np.zeros_like(q))
        found = {"J_theta": np.moveaxis(values["J_theta"], -1, 0).transpose(0, 2, 1)}
        found["M_J"] = np.moveaxis(values["M_J"], -1, 0)
        for name in ("M_1", "M_2", "M_3"):
            found[name] = values[name].transpose(3, 2, 0, 1)
        return found

    def _at(self, question: str, q: Array, q1: Array) -> dict[str, Array]:
        """Results of a question on the platform's motion, at whole poses the contacts meet."""
        poses, reached = self.whole(q, q1, np.zeros_like(q))
        if not reached.all():
            sample = int(np.argmin(reached))
            raise InputError(f"the contacts cannot be met at sample {sample}: q = {q[sample]}")
        kernel = self._system.kernel(question)
        return kernel.run({port.name: poses[port.name] for port in kernel.interface.ports}).values

    def whole(self, q: Array, q1: Array, q2: Array) -> tuple[dict[str, Array], Array]:
        """X_EE and its rates, (N, 6) each, and where the contacts can be met."""
        inputs = {"q": q, "q1": q1, "q2": q2}
        answer = self._system.kernel("motion").run(inputs)
        mended(answer, inputs, lambda few: self._system.robust.motion(few))
        return {name: a.T for name, a in answer.values.items()}, answer.status == Status.ok

    def of_motion(self, motion: Motion) -> tuple[States, float | None]:
        """As `Model.independent_motion`."""
        given = (motion.value, motion.rate, motion.acceleration)
        if motion.kind == "pose":
            columns = indices(self._system.independent)
            q, q1, q2 = (a[:, columns] for a in given)
            return (q, q1, q2), self.contact_residual(motion.value)
        landmark = None
        if motion.kind == "landmark":
            landmark = resolve_landmark(motion.landmark, self._system.mechanism.platform.points)
        return self.states(motion.names, given, landmark, None), None

    def contact_residual(self, pose: Array) -> float:
        """As `Model.contact_residual`."""
        if not self._system.mechanism.contacts:
            return 0.0
        phi = self._system.kernel("encoders").run({"pose": pose}).values["phi"]
        return float(np.nanmax(np.abs(phi)))

    def states(
        self, names: Collection[str], given: States, landmark: str | None, threads: int | None
    ) -> States:
        """As `Model.independent_states`."""
        names, independent = list(names), self._system.independent
        if landmark is None and sorted(names) == sorted(independent):
            return given if tuple(names) == independent else _ordered(given, names, independent)
        closure = self._system.closure(tuple(names), landmark)
        if landmark is None:
            given = _ordered(given, names, closure.names)
        else:
            # The fourth condition prescribes zero: the midpoint of the contacts stays put.
            s, s1, s2 = (np.column_stack([a, np.zeros(len(a))]) for a in given)
            given = s, s1, s2
        found = closure.solve(*given, threads)
        columns = indices(independent)
        q, q1, q2 = (a[:, columns] for a in (found.pose, found.rate, found.acceleration))
        return q, q1, q2


def _ordered(given: States, names: list[str], wanted: Collection[str]) -> States:
    order = [names.index(name) for name in wanted]
    q, q1, q2 = (a[:, order] for a in given)
    return q, q1, q2


def configured(values: Mapping[str, Array], length: float) -> Configuration:
    """Results of a kernel, samples last, as a configuration; length: the characteristic one [m]."""
    joint, beta, gamma, cos_gamma, discriminant = (
        values[name].T for name in ("joint", "beta", "gamma", "cos_gamma", "discriminant")
    )
    points, normals = (
        np.moveaxis(values[name], -1, 0) for name in ("contact_point", "contact_normal")
    )
    measures = singularity(values, length)
    return Configuration(joint, beta, gamma, cos_gamma, discriminant, points, normals, measures)


def singularity(values: Mapping[str, Array], length: float) -> Singularity:
    """Its singularity measures alone."""
    J_A, transmission, sigma = (values[name].T for name in ("J_A", "transmission", "J_W_sigma"))
    return Singularity.of(J_A, transmission, sigma, values["J_A_extremes"], length)
