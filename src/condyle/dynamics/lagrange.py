"""Lagrange-D'Alembert formulation ([Cheng2023] Section 5, eqs 48-64).

Platform and chains are cut apart, each written by Lagrange in its own coordinates,

    M(c) c'' + C(c, c') c' + G(c),   C = M' - (1/2) (E (x) c')^T dM/dc,

and joined by the principle of D'Alembert. (The paper prints C times the second derivative.)
"""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from ..kinematics.chain import ChainDynamics, Constants, Family, Link
from ..kinematics.state import PointMotion, State
from .formulation import Body
from .joint_space import JointState, joint_space_dynamics


class Lagrange:
    name: ClassVar[str] = "lagrange"
    uses_twist: ClassVar[bool] = False
    lumps: ClassVar[bool] = False
    pads: ClassVar[bool] = False

    def platform(self, state: State, body: Body, g: ca.SX) -> ca.SX:
        """Eqs (48)-(52)."""
        inertia = state.R @ body.inertia @ state.R.T
        J = state.B
        mass_matrix = body.mass * (J[:3, :].T @ J[:3, :]) + J[3:, :].T @ inertia @ J[3:, :]
        potential = -body.mass * ca.dot(g, state.pose[:3])
        c = state.coordinates
        return lagrange_force(mass_matrix, potential, c, state.rate, state.acceleration)

    def chain(self, family: Family, c: Constants, M: PointMotion, g: ca.SX) -> ChainDynamics:
        return joint_space_dynamics(family, c, M, g, link_force)


def link_force(link: Link, s: JointState, g: ca.SX) -> ca.SX:
    """Eq. (53): one moving link, dual to q_r', (3,)."""
    J_E = ca.jacobian(link.centre, s.q)
    mass_matrix = link.mass * (J_E.T @ J_E) + link.spin.T @ link.inertia @ link.spin
    potential = -link.mass * ca.dot(g, link.centre)
    return lagrange_force(mass_matrix, potential, s.q, s.rate, s.acceleration)


def lagrange_force(
    mass_matrix: ca.SX, potential: ca.SX, c: ca.SX, rate: ca.SX, acceleration: ca.SX
) -> ca.SX:
    """M c'' + C c' + G of one body, (m,)."""
    momentum = mass_matrix @ rate
    M_rate_times_rate = ca.jtimes(momentum, c, rate)
    half_gradient = ca.gradient(ca.dot(rate, momentum), c) / 2
    return (
        mass_matrix @ acceleration + (M_rate_times_rate - half_gradient) + ca.gradient(potential, c)
    )
