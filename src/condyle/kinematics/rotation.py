"""Bryant angles: the rotation of the platform and its rates ([Cheng2023] eqs 2, 8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

# |cos beta| below which rates of the angles do not describe every motion,
GIMBAL_LOCK = 1e-7
NEAR_LOCK = 1e-4  # and below which equations in these rates lose digits that twists keep.


def matrix(rows: list[list[Any]]) -> ca.SX:
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def rotation_x(c: ca.SX, s: ca.SX) -> ca.SX:
    return matrix([[1, 0, 0], [0, c, -s], [0, s, c]])


def rotation_y(c: ca.SX, s: ca.SX) -> ca.SX:
    return matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rotation_z(c: ca.SX, s: ca.SX) -> ca.SX:
    return matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])


@dataclass(frozen=True)
class Bryant:
    """Cosines and sines of (alpha, beta, gamma), (3,) each.

    Where the contacts give an angle by its tangent, these come without arc functions.
    """

    cos: ca.SX
    sin: ca.SX

    @staticmethod
    def of(angles: ca.SX) -> Bryant:
        return Bryant(ca.cos(angles), ca.sin(angles))

    def rotation(self) -> ca.SX:
        """R = Rx(alpha) Ry(beta) Rz(gamma), (3, 3): components in {M} to components in {S}.

        [Cheng2023] eq. (2); the paper's words say the inverse, its formulas this.
        """
        c, s = self.cos, self.sin
        return rotation_x(c[0], s[0]) @ rotation_y(c[1], s[1]) @ rotation_z(c[2], s[2])

    def angular_velocity(self) -> ca.SX:
        """R_omega, (3, 3): omega = R_omega (alpha', beta', gamma') in {S}.

        [Cheng2023] eq. (8), the sign of the last entry mended: the columns are the axes of
        alpha', beta' and gamma'.
        """
        c, s = self.cos, self.sin
        return matrix([[1, 0, s[1]], [0, c[0], -s[0] * c[1]], [0, s[0], c[0] * c[1]]])

    def twist_jacobian(self) -> ca.SX:
        """E, (6, 6): [V; omega] = E X_EE'."""
        return ca.diagcat(ca.SX.eye(3), self.angular_velocity())


def rotation(angles: ca.SX) -> ca.SX:
    """R of (alpha, beta, gamma) [rad], (3, 3)."""
    return Bryant.of(angles).rotation()


def turn_by(angle: ca.SX) -> ca.SX:
    """Cosine and sine, (2,), of 2 atan(angle / 2): near those of the angle, of length 1."""
    t = angle / 2
    scale = 1 / (1 + t * t)
    return ca.vertcat((1 - t * t) * scale, 2 * t * scale)


def turned(turn: ca.SX, by: ca.SX) -> ca.SX:
    """Cosine and sine of the sum of two angles, from theirs, (2,) each."""
    return ca.vertcat(turn[0] * by[0] - turn[1] * by[1], turn[1] * by[0] + turn[0] * by[1])


def turned_slightly(turn: ca.SX, x: ca.SX) -> ca.SX:
    """The same for an angle x whose fourth power is below rounding."""
    c, s = turn[0], turn[1]
    return ca.vertcat(
        c - x * (s + x * (c / 2 - x * (s / 6))),
        s + x * (c - x * (s / 2 + x * (c / 6))),
    )
