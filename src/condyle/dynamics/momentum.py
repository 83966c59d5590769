"""Generalized momentum approach ([Cheng2023] Section 4, eqs 29-47).

The force of a body is the derivative of its momentum, mapped to the coordinates by the body's
velocity Jacobian J,

    F = J^T d/dt (M J c') + dP/dc.

The paper's eqs (30), (34) leave J^T out; d/dt (J^T M J c') instead would lose a term.
"""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from ..kinematics.chain import ChainDynamics, Constants, Family, Link
from ..kinematics.state import PointMotion, State
from .formulation import Body
from .joint_space import JointState, joint_space_dynamics


class Momentum:
    name: ClassVar[str] = "momentum"
    uses_twist: ClassVar[bool] = False
    lumps: ClassVar[bool] = False
    pads: ClassVar[bool] = False

    def platform(self, state: State, body: Body, g: ca.SX) -> ca.SX:
        """Eqs (29)-(32)."""
        inertia = state.R @ body.inertia @ state.R.T
        momentum = ca.vertcat(body.mass * state.twist[:3], inertia @ state.twist[3:])
        potential = -body.mass * ca.dot(g, state.pose[:3])
        kinetic = state.B.T @ state.time_derivative(momentum)
        return kinetic + ca.gradient(potential, state.coordinates)

    def chain(self, family: Family, c: Constants, M: PointMotion, g: ca.SX) -> ChainDynamics:
        return joint_space_dynamics(family, c, M, g, link_force)


def link_force(link: Link, s: JointState, g: ca.SX) -> ca.SX:
    """Eqs (33)-(40): one moving link, dual to q_r', (3,)."""
    J_E = ca.jacobian(link.centre, s.q)
    linear = link.mass * (J_E @ s.rate)
    angular = link.inertia @ (link.spin @ s.rate)
    kinetic = J_E.T @ s.time_derivative(linear) + link.spin.T @ s.time_derivative(angular)
    potential = -link.mass * ca.dot(g, link.centre)
    return kinetic + ca.gradient(potential, s.q)
