"""Generalized momentum approach ([Cheng2023] Section 4, eqs 29-47).

The force of a body is the derivative of its momentum, mapped to the coordinates by the body's
velocity Jacobian J,

    F = J^T d/dt (M J c') + dP/dc.

The paper's eqs (30), (34) leave J^T out; d/dt (J^T M J c') instead would lose a term.
"""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from ..kinematics.chain import Link
from ..kinematics.state import State
from .formulation import PlatformBody
from .joint_space import JointSpace, JointState, weight


class Momentum(JointSpace):
    name: ClassVar[str] = "momentum"

    def platform(self, state: State, body: PlatformBody, g: ca.SX) -> ca.SX:
        """Eqs (29)-(32)."""
        momentum = body.of_twist(state.R) @ state.twist
        # The angular one is about O_M, which moves: V x (m V + omega x S) is lost on the way.
        moving = ca.cross(state.twist[:3], ca.cross(state.twist[3:], state.R @ body.first_moment))
        change = state.time_derivative(momentum) + ca.vertcat(ca.SX.zeros(3), moving)
        height = body.height(state.pose[:3], state.R)
        return state.B.T @ change + weight(height, g, state.coordinates)

    def link_force(self, link: Link, s: JointState, g: ca.SX) -> ca.SX:
        """Eqs (33)-(40)."""
        J_E = ca.jacobian(link.centre, s.q)
        linear = link.mass * (J_E @ s.rate)
        angular = link.inertia @ (link.spin @ s.rate)
        kinetic = J_E.T @ s.time_derivative(linear) + link.spin.T @ s.time_derivative(angular)
        return kinetic + weight(link.mass * link.centre, g, s.q)
