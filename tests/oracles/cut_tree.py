"""Dynamics of the cut-open tree, whichever engine computes it.

Each chain is cut at its spherical joints. The platform is three slides, then Rx, Ry, Rz, so that
its velocity is X_EE'. A crank or slider is a branch; its rod is a branch of three slides, Ry and
Rz in the *base* frame N_i0: a universal joint fixed on the crank would be another mechanism.
Loops are closed by the Jacobians of the points where the tree was cut.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .closure import contact_normals, distribute
from .description import Description, Raw, joint, read, rod_angles
from .rotations import platform_motion

Array = np.ndarray


@dataclass(frozen=True)
class Joints:
    """M: (nv, nv); h: (nv,); L: (rows, nv), its drift L' v: (rows,); v: (nv,)."""

    M: Array
    h: Array
    L: Array
    drift: Array
    v: Array


class CutTree(ABC):
    """The tree of one mechanism in one engine; one call, one sample.

    drives: velocity index of each chain's actuator.
    """

    d: Description
    drives: list[int]
    along_rod: ClassVar[bool] = False  # whether a rod's slides are along N_i0, else along {S}

    def __init__(self, description: Raw | Description) -> None:
        self.d = read(description)

    @abstractmethod
    def place(self, q: Array) -> Array:
        """Put the tree there; gaps where it was cut, (cuts, 3)."""

    @abstractmethod
    def loops(self) -> Array:
        """L, (rows, nv): L v = 0 keeps the loops closed."""

    @abstractmethod
    def drift(self, q: Array, v: Array) -> Array:
        """L' v, (rows,)."""

    @abstractmethod
    def points(self) -> Array:
        """Velocities of the contact points by X_EE', (k, 3, 6)."""

    @abstractmethod
    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Forces of the whole tree, (nv,)."""

    @abstractmethod
    def matrices(self, q: Array, v: Array) -> tuple[Array, Array]:
        """M, (nv, nv), and h, (nv,): forces at no acceleration."""

    def coordinates(self, pose: Array) -> Array:
        """All tree coordinates, with the loops closed to rounding; ValueError if out of reach."""
        motion, parts = platform_motion(pose), [pose]
        for chain in self.d.chains:
            P = motion.point(chain.M)[0]
            travel, S = joint(chain, P)
            angles, moved = rod_angles(chain, P - S), S - chain.S
            if chain.kind == "SPS":
                parts.append(np.array([*angles, travel]))
            else:
                moved = chain.N0.T @ moved if self.along_rod else moved
                parts.append(np.array([travel, *moved, *angles]))
        q = np.concatenate(parts)
        if not np.abs(self.place(q)).max() < 1e-12 * max(1, self.d.size):
            raise ValueError("the pose is out of reach")
        return q

    def inverse_dynamics(
        self,
        pose: Array,
        pose_rate: Array,
        pose_acceleration: Array,
        wrench: Array,
        load_point: str | Array | None = "right_molar",
    ) -> dict[str, Array]:
        """Minimum-norm torques, contact forces and joint motion, SI.

        Args:    wrench: force and moment on the platform at `load_point`, (6,) in {S}.
        Returns: tau; joint, beta_i, gamma_i, each also with `_rate` and `_acceleration`, (n,);
                 contact, (k,): force of the surface on the platform along the unit normal;
                 Q, (6,): generalized force dual to X_EE'; J_theta, (n, 6); C_normal, (k, 6);
                 tree_q, tree_v: all coordinates and rates of the tree.
        """
        q = self.coordinates(np.asarray(pose, float))
        L, points = self.loops(), self.points()
        K = -np.linalg.solve(L[:, 6:], L[:, :6])  # chain rates per X_EE'
        v = np.concatenate([pose_rate, K @ pose_rate])
        chains = K @ pose_acceleration - np.linalg.solve(L[:, 6:], self.drift(q, v))
        a = np.concatenate([pose_acceleration, chains])
        forces = self.inverse(q, v, a)
        motion = platform_motion(np.asarray(pose, float))
        arm = motion.jacobian(self.d.load_point(load_point))
        turning = np.hstack([np.zeros((3, 3)), motion.axes])
        Q = forces[:6] + K.T @ forces[6:] - arm.T @ wrench[:3] - turning.T @ wrench[3:]
        J = K[[drive - 6 for drive in self.drives]]
        N = np.einsum("ki,kij->kj", contact_normals(self.d, motion), points)
        tau, contact = distribute(Q, J, N, self.d.size)
        result = {"tau": tau, "contact": contact, "Q": Q, "J_theta": J, "C_normal": N}
        return result | {"tree_q": q, "tree_v": v} | self._named(q, v, a)

    def joints(self, pose: Array, rate: Array) -> Joints:
        """What forward dynamics asks for."""
        q = self.coordinates(pose)
        L = self.loops()
        v = np.concatenate([rate, -np.linalg.solve(L[:, 6:], L[:, :6] @ rate)])
        drift = self.drift(q, v)
        return Joints(*self.matrices(q, v), L, drift, v)

    def _named(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Joint coordinate, beta_i and gamma_i of each chain with their derivatives."""
        ahead = [-2 if chain.kind == "SPS" else 4 for chain in self.d.chains]  # drive to beta_i
        swing = [i + step for i, step in zip(self.drives, ahead, strict=True)]
        places = {"joint": self.drives, "beta_i": swing, "gamma_i": [i + 1 for i in swing]}
        sorts = {"": q, "_rate": v, "_acceleration": a}
        return {name + s: x[i] for name, i in places.items() for s, x in sorts.items()}
