"""What a pose is like: configuration, singularity, matrices of the equations of motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cached_property, partial

import numpy as np

from ..backends.kernel import AGAIN
from ..errors import InputError, did_you_mean
from ..kinematics.constraints import closed_form_available
from ..kinematics.singularities import Singularity
from ..status import Status
from .checks import POSE_COLUMNS, check_array, check_states
from .data import Configuration
from .derivation import Derivation
from .survey import SURVEYED, Survey, judged


class Poses(Derivation):
    """Questions about poses, none of which is about efforts."""

    def configuration(self, pose: np.ndarray, threads: int | None = None) -> Configuration:
        """Joint coordinates, contact points and singularity measures at poses X_EE, (N, 6)."""
        check_array("pose", pose, 6, POSE_COLUMNS)
        answer = self.kernel("configuration").run({"pose": pose}, threads)
        again = np.flatnonzero(answer.status == AGAIN)
        if again.size:
            better = self._robust.configuration(np.asarray(pose, dtype=float)[again])
            for name, value in answer.values.items():
                value[..., again] = better[name]
        return configured(answer.values, self.characteristic_length)

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
        kernel = self.kernel(question)
        return kernel.run({port.name: poses[port.name] for port in kernel.interface.ports}).values

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


def configured(values: Mapping[str, np.ndarray], length: float) -> Configuration:
    """Results of a kernel, samples last, as a configuration; length: the characteristic one [m]."""
    joint, beta, gamma, cos_gamma, discriminant = (
        values[name].T for name in ("joint", "beta", "gamma", "cos_gamma", "discriminant")
    )
    points, normals = (
        np.moveaxis(values[name], -1, 0) for name in ("contact_point", "contact_normal")
    )
    measures = singularity(values, length)
    return Configuration(joint, beta, gamma, cos_gamma, discriminant, points, normals, measures)


def singularity(values: Mapping[str, np.ndarray], length: float) -> Singularity:
    """Its singularity measures alone."""
    J_A, transmission, sigma = (values[name].T for name in ("J_A", "transmission", "J_W_sigma"))
    return Singularity.of(J_A, transmission, sigma, values["J_A_extremes"], length)
