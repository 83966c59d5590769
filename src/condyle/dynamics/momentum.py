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
from .formulation import Body
from .joint_space import JointSpace, JointState, weight


class Momentum(JointSpace):
    name: ClassVar[str] = "momentum"

    def platform(self, state: State, body: Body, g: ca.SX) -> ca.SX:
        """Eqs (29)-(32)."""
        inertia = state.R @ body.inertia @ state.R.T
        momentum = ca.vertcat(body.mass * state.twist[:3], inertia @ state.twist[3:])
        kinetic = state.B.T @ state.time_derivative(momentum)
        return kinetic + weight(body.mass, state.pose[:3], g, state.coordinates)

    def link_force(self, link: Link, s: JointState, g: ca.SX) -> ca.SX:
        """Eqs (33)-(40)."""
        J_E = ca.jacobian(link.centre, s.q)
        linear = link.mass * (J_E @ s.rate)
        angular = link.inertia @ (link.spin @ s.rate)
        kinetic = J_E.T @ s.time_derivative(linear) + link.spin.T @ s.time_derivative(angular)
        return kinetic + weight(link.mass, link.centre, g, s.q)
