"""The interface of a formulation: the platform's generalized force, and the dynamics of a chain.

A formulation sees the platform through a `State` and each chain through the motion of its joint M
alone, so that one text serves every route, every family and any number of contacts:

    sum of forces, dual to c' = J_theta^T tau + bite        [Cheng2023] eqs (43), (46), (57), (63)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from ..kinematics.chain import ChainDynamics, Constants, Family
from ..kinematics.moving_base import MovingBase
from ..kinematics.state import PointMotion, State


@dataclass(frozen=True)
class PlatformBody:
    """The platform: mass [kg], first moment s (3,) [kg m] and inertia I (3, 3) about O_M in {M}.

    The paper's platform has its mass centre at O_M, so its first moment vanishes.
    """

    mass: ca.SX
    first_moment: ca.SX
    inertia: ca.SX

    def of_twist(self, R: ca.SX) -> ca.SX:
        """Inertia dual to the twist, (6, 6): [m E, -[S]; [S], R I R^T] with S = R s."""
        spin, turned = ca.skew(R @ self.first_moment), R @ self.inertia @ R.T
        return ca.vertcat(ca.horzcat(self.mass * ca.SX.eye(3), spin.T), ca.horzcat(spin, turned))

    def kinetic(self, R: ca.SX, V: ca.SX, omega: ca.SX) -> ca.SX:
        """Kinetic energy [J]: m V^2 / 2 + V . (omega x S) + omega . I omega / 2."""
        spin = R.T @ omega
        square = self.mass * ca.dot(V, V) + ca.dot(spin, self.inertia @ spin)
        return square / 2 + ca.dot(V, ca.cross(omega, R @ self.first_moment))

    def height(self, position: ca.SX, R: ca.SX) -> ca.SX:
        """Mass times the place of the mass centre in {S}, (3,) [kg m]: m O_M + S."""
        return self.mass * position + R @ self.first_moment

    def carried(self, state: State, base: MovingBase) -> ca.SX:
        """Force and moment about O_M, (6,), that a moving base adds."""
        V, omega, S = state.twist[:3], state.twist[3:], state.R @ self.first_moment
        here = base.acceleration(state.pose[:3], V)
        force = self.mass * here + base.turning(S, ca.cross(omega, S))
        turned = base.moment(state.R @ self.inertia @ state.R.T, omega)
        return ca.vertcat(force, ca.cross(S, here) + turned)


class Formulation(ABC):
    """One way to write the equations of motion."""

    name: ClassVar[str]
    uses_twist: ClassVar[bool] = False  # whether route `core` works in twist coordinates
    # Whether a chain's bodies can act as one, with end masses that are part of the platform, and
    # whether padding constants (`Family.padding`) alone make a lane vanish.
    lumps: ClassVar[bool] = False
    pads: ClassVar[bool] = False

    @abstractmethod
    def platform(self, state: State, body: PlatformBody, g: ca.SX) -> ca.SX:
        """Inertia less gravity of the platform, dual to the state's c', (m,)."""

    @abstractmethod
    def chain(self, family: Family, c: Constants, M: PointMotion, g: ca.SX) -> ChainDynamics:
        """Forces of a chain's bodies on its platform joint, and the joint's motion."""

    def carried_chain(
        self, family: Family, c: Constants, M: PointMotion, base: MovingBase
    ) -> ca.SX:
        """What a moving base adds to these forces, (3,)."""
        return family.carried(c, M.position, M.velocity, base)
