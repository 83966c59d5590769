"""The platform's motion, in the coordinates a formulation chooses.

Three spaces carry the same motion:

    independent   c = q_EE   forces dual to q_EE'      Model 1, route `direct`
    pose          c = X_EE   forces dual to X_EE'      Model 2, route `core`
    twist         c' = [V; omega]  forces dual to it   the operation-minimal formulation

A state gives every formulation the motion of a platform point and the generalized force of a
force that acts there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from .rotation import Bryant


@dataclass(frozen=True)
class PointMotion:
    """A platform point in {S}: position, velocity, acceleration, each (3,), and its lever r."""

    position: ca.SX
    velocity: ca.SX
    acceleration: ca.SX
    lever: ca.SX


@dataclass(frozen=True)
class State:
    """The platform's motion.

    rate, acceleration: c' and c'', (m,).
    pose:    X_EE, (6,), an expression in c.
    twist:   [V; omega], (6,); twist_rate its time derivative.
    B:       twist Jacobian, (6, m): [V; omega] = B c'  ([Cheng2023] eqs 8, 11).
    """

    rate: ca.SX
    acceleration: ca.SX
    pose: ca.SX
    R: ca.SX
    twist: ca.SX
    twist_rate: ca.SX
    B: ca.SX
    coordinates: ca.SX  # c, (m,); empty in the twist space, which has no coordinates

    def point(self, m: ca.SX) -> PointMotion:
        """Motion of the platform point with components `m`, (3,) [m], in {M}."""
        r = self.R @ m
        return PointMotion(
            position=self.pose[:3] + r,
            velocity=self.twist[:3] + ca.cross(self.twist[3:], r),
            acceleration=self.twist_rate[:3] + self.lever_acceleration @ r,
            lever=r,
        )

    @cached_property
    def lever_acceleration(self) -> ca.SX:
        """[omega'] + [omega]^2, (3, 3): times a lever, its acceleration about O_M."""
        spin = ca.skew(self.twist[3:])
        return ca.skew(self.twist_rate[3:]) + spin @ spin

    def generalized_force(self, force: ca.SX, lever: ca.SX) -> ca.SX:
        """Generalized force, (m,), of a force (3,) acting at `lever` from O_M: M_2^T force."""
        return self.B.T @ ca.vertcat(force, ca.cross(lever, force))

    def time_derivative(self, expression: ca.SX) -> ca.SX:
        """d/dt of an expression in c and c'."""
        return ca.jtimes(expression, self.coordinates, self.rate) + ca.jtimes(
            expression, self.rate, self.acceleration
        )


def pose_state(pose: ca.SX, rate: ca.SX, acceleration: ca.SX, q: ca.SX | None = None) -> State:
    """State in X_EE (route `core`), or in q with the closed form pose(q) (route `direct`)."""
    bryant = Bryant.of(pose[3:])
    E, c = bryant.twist_jacobian(), pose if q is None else q
    B = E if q is None else E @ ca.jacobian(pose, q)
    twist = B @ rate
    twist_rate = B @ acceleration + ca.jtimes(twist, c, rate)
    return State(rate, acceleration, pose, bryant.rotation(), twist, twist_rate, B, c)


def twist_state(pose: ca.SX, R: ca.SX, twist: ca.SX, twist_rate: ca.SX) -> State:
    """State whose forces are dual to the twist [V; omega]."""
    return State(twist, twist_rate, pose, R, twist, twist_rate, ca.SX.eye(6), ca.SX(0, 1))
