"""The interpreter: CasADi's virtual machine for the expressions, numpy for the distribution.

Needs no compiler. Its numbers are the reference for the compiled kernels.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..backends.threads import workers
from ..dynamics.distribution import minimum_norm
from ..dynamics.equations import (
    closure_function,
    core_function,
    direct_function,
    has_closed_form,
    part_names,
)
from ..dynamics.formulation import Formulation
from ..kinematics.batch import evaluate
from ..kinematics.closure import coordinate_closure
from ..kinematics.contact import indices
from ..mechanism.home import characteristic_length, independent_coordinates
from ..mechanism.mechanism import Mechanism
from ..questions.spec import OUTPUTS
from .result import PoseRates, Torques


class Interpreted:
    """Inverse dynamics of one mechanism by one formulation and route."""

    name = "interpreted"

    def __init__(self, mechanism: Mechanism, formulation: Formulation, route: str) -> None:
        self._n = len(mechanism.chains)
        self._parts = len(part_names(mechanism))
        independent = independent_coordinates(mechanism)
        self._closed = closure_function(mechanism) if has_closed_form(mechanism) else None
        self._newton = None if self._closed else coordinate_closure(mechanism, independent)
        direct = route == "direct"
        self._direct = direct_function(mechanism, formulation) if direct else None
        # Route `direct` has no equations across the contacts: their forces come from the core.
        self._core_of = lambda: core_function(mechanism, formulation)
        self._core = None if direct else self._core_of()
        angles = np.array([i >= 3 for i in indices(independent)])
        self._scale = np.where(angles, characteristic_length(mechanism), 1.0)

    def solve(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        outputs: Collection[str] = OUTPUTS,
        threads: int | None = None,
    ) -> Torques:
        """Efforts at N samples of the independent coordinates, (N, m) each, under loads (N, 9).

        Args: outputs: what is wanted besides the efforts, of `OUTPUTS`; here only the contact
              forces cost extra.
              threads: makes no difference here.
        Raises: InputError: for less than one thread.
        """
        workers(threads)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            poses = self.poses(q, q1, q2)
            return self.torques(q, q1, q2, load, poses, "contact" in outputs)

    def poses(self, q: np.ndarray, q1: np.ndarray, q2: np.ndarray) -> PoseRates:
        """Close the contacts at N samples of the independent coordinates, (N, m) each."""
        if self._newton is not None:
            motion = self._newton.solve(q, q1, q2)
            return PoseRates(motion.pose, motion.rate, motion.acceleration, motion.reached)
        assert self._closed is not None
        pose, rate, acceleration, reach = evaluate(self._closed, q, q1, q2)
        return PoseRates(pose, rate, acceleration, reach[:, 0] >= 0)

    def torques(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        poses: PoseRates,
        contact_forces: bool = True,
    ) -> Torques:
        """Efforts at N samples.

        Args: load: (N, 9): force and moment in {S}, and the point they act at in {M}.
              poses: of the same samples.
        """
        if self._direct is not None:
            outputs = evaluate(self._direct, q, q1, q2, load)
        else:
            outputs = self._evaluate_core(poses, load)
        forces, J, Pi, rate, acceleration, reach = outputs[:6]
        forces, J, Pi = self._matrices(forces, J, Pi)
        b = Pi.transpose(0, 2, 1) @ forces
        distribution = minimum_norm(J @ Pi, self._scale)
        share = distribution.torques(b)
        torque = share.sum(axis=2)
        contact = self._contact_forces(poses, load, torque, outputs) if contact_forces else None
        return Torques(
            torque=torque,
            share=share.transpose(2, 0, 1),
            contact_force=contact,
            rate=rate,
            acceleration=acceleration,
            reached=poses.reached & (reach >= 0).all(axis=1),
            poses=poses,
            uncertain=np.ones(len(q), dtype=bool),
        )

    def _contact_forces(
        self, poses: PoseRates, load: np.ndarray, torque: np.ndarray, outputs: list[np.ndarray]
    ) -> np.ndarray:
        """lambda along the unit normals, (N, k), from what the torques leave over."""
        if self._direct is not None:
            self._core = self._core or self._core_of()
            outputs = self._evaluate_core(poses, load)
        forces, J, _ = self._matrices(*outputs[:3])
        G, n_length = outputs[6], outputs[7]
        k = n_length.shape[1]
        if not k:
            return np.zeros((len(torque), 0))
        G = G.reshape(len(G), k, 6).transpose(0, 2, 1)
        left = forces.sum(axis=2) - (J.transpose(0, 2, 1) @ torque[..., None])[..., 0]
        mu = np.full((len(G), k), np.nan)
        good = np.isfinite(left).all(axis=1) & np.isfinite(G).all(axis=(1, 2))
        mu[good] = (np.linalg.pinv(G[good]) @ left[good][..., None])[..., 0]
        return mu * n_length

    def _evaluate_core(self, poses: PoseRates, load: np.ndarray) -> list[np.ndarray]:
        assert self._core is not None
        return evaluate(self._core, poses.pose, poses.rate, poses.acceleration, load)

    def _matrices(self, forces: np.ndarray, J: np.ndarray, Pi: np.ndarray) -> list[np.ndarray]:
        """Columns as CasADi returns them, to (N, s, parts), (N, n, s) and (N, s, m)."""
        count = len(forces)
        s = J.shape[1] // self._n
        shapes = ((self._parts, s), (s, self._n), (len(self._scale), s))
        return [
            a.reshape(count, *shape).transpose(0, 2, 1)
            for a, shape in zip((forces, J, Pi), shapes, strict=True)
        ]
