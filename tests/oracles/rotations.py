"""Rotations and the motion of a platform with the pose X_EE = (X, Y, Z, alpha, beta, gamma)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
X, Y, Z = np.eye(3)


def unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def turn(axis: Array, angle: float) -> Array:
    """Rotation matrix about a unit axis (Rodrigues)."""
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def bryant(angles: Sequence[float] | Array) -> Array:
    """R = Rx(alpha) Ry(beta) Rz(gamma)."""
    alpha, beta, gamma = angles
    return turn(X, alpha) @ turn(Y, beta) @ turn(Z, gamma)


@dataclass(frozen=True)
class Motion:
    """Position, velocity and acceleration of a moving frame, all in {S}."""

    origin: Array
    R: Array
    axes: Array  # (3, 3), columns: the axes of alpha', beta', gamma' (R_omega)
    velocity: Array
    omega: Array
    acceleration: Array
    omega_rate: Array

    def point(self, t: Array) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration of the platform point t (in {M})."""
        r = self.R @ t
        swing = np.cross(self.omega, r)
        acceleration = (
            self.acceleration + np.cross(self.omega_rate, r) + np.cross(self.omega, swing)
        )
        return self.origin + r, self.velocity + swing, acceleration

    def jacobian(self, t: Array) -> Array:
        """d point / d X_EE, (3, 6)."""
        return np.hstack([np.eye(3), np.cross(self.axes, self.R @ t, axisa=0, axisc=0)])


def per_twist(pose: Array, M_J: Array, length: float) -> Array:
    """(m, m): q' of orthonormal twists [V; length omega] in the span of those that q' has."""
    E = np.eye(6)
    E[3:, 3:] = length * platform_motion(pose).axes
    return np.linalg.inv(np.linalg.qr(E @ M_J)[1])


def platform_motion(pose: Array, rate: Array | None = None, second: Array | None = None) -> Motion:
    """Motion of {M} from the pose and its derivatives, (6,) each."""
    rate = np.zeros(6) if rate is None else rate
    second = np.zeros(6) if second is None else second
    alpha, beta, _ = pose[3:]
    axes = np.stack([X, turn(X, alpha) @ Y, turn(X, alpha) @ turn(Y, beta) @ Z], axis=1)
    a, b, c = (axes * rate[3:]).T
    omega_rate = axes @ second[3:] + np.cross(a, b) + np.cross(a + b, c)
    return Motion(pose[:3], bryant(pose[3:]), axes, rate[:3], a + b + c, second[:3], omega_rate)
