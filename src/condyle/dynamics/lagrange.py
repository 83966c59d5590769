"""Lagrange-D'Alembert formulation ([Cheng2023] Section 5, eqs 48-64).

Platform and chains are cut apart, each written by Lagrange in its own coordinates,

    M(c) c'' + C(c, c') c' + G(c),   C = M' - (1/2) (E (x) c')^T dM/dc,

and joined by the principle of D'Alembert. (The paper prints C times the second derivative.)
"""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from ..kinematics.chain import Link
from ..kinematics.state import State
from .formulation import PlatformBody
from .joint_space import JointSpace, JointState, weight


class Lagrange(JointSpace):
    name: ClassVar[str] = "lagrange"

    def platform(self, state: State, body: PlatformBody, g: ca.SX) -> ca.SX:
        """Eqs (48)-(52)."""
        c = state.coordinates
        mass_matrix = state.B.T @ body.of_twist(state.R) @ state.B
        force = lagrange_force(mass_matrix, c, state.rate, state.acceleration)
        return force + weight(body.height(state.pose[:3], state.R), g, c)

    def link_force(self, link: Link, s: JointState, g: ca.SX) -> ca.SX:
        """Eq. (53)."""
        J_E = ca.jacobian(link.centre, s.q)
        mass_matrix = link.mass * (J_E.T @ J_E) + link.spin.T @ link.inertia @ link.spin
        force = lagrange_force(mass_matrix, s.q, s.rate, s.acceleration)
        return force + weight(link.mass * link.centre, g, s.q)


def lagrange_force(mass_matrix: ca.SX, c: ca.SX, rate: ca.SX, acceleration: ca.SX) -> ca.SX:
    """M c'' + C c' of one body, (m,)."""
    momentum = mass_matrix @ rate
    M_rate_times_rate = ca.jtimes(momentum, c, rate)
    half_gradient = ca.gradient(ca.dot(rate, momentum), c) / 2
    return mass_matrix @ acceleration + (M_rate_times_rate - half_gradient)
