"""Lagrange-D'Alembert with Jacobian and Hessian matrices, [27] of [Cheng2023] (Abo-Shanab 2020).

Bodies and constraints each give one Jacobian and one Hessian, and nothing is differentiated by
time. The kinetic energy T(c, c') of a body has the Hessian

    [ T_cc    T_cc'  ]
    [ T_c'c   T_c'c' ],    inertia force = T_c'c' c'' + T_c'c c' - T_c,

with the mass matrix T_c'c'. The loop constraints f = end_point(q_r) - M = 0 of a chain have the
Jacobian M_1 = d end_point / d q_r and, one for each component a, a Hessian H_a, so that

    q_r'  = M_1^-1 M',    q_r'' = M_1^-1 (M'' - [q_r'^T H_a q_r']_a).

By D'Alembert a force f_r dual to q_r' acts as M_1^-T f_r on M. [Cheng2023] names this form as
future work and does not print it; this one follows from its title.
"""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from ..kinematics.chain import Link
from ..kinematics.state import State
from .formulation import PlatformBody
from .joint_space import JointSpace, JointState, weight


class Hessian(JointSpace):
    name: ClassVar[str] = "hessian"

    def platform(self, state: State, body: PlatformBody, g: ca.SX) -> ca.SX:
        kinetic, c = body.kinetic(state.R, state.twist[:3], state.twist[3:]), state.coordinates
        force = hessian_force(kinetic, c, state.rate, state.acceleration)
        return force + weight(body.height(state.pose[:3], state.R), g, c)

    def link_force(self, link: Link, s: JointState, g: ca.SX) -> ca.SX:
        V, omega = ca.jacobian(link.centre, s.q) @ s.rate, link.spin @ s.rate
        kinetic = (link.mass * ca.dot(V, V) + ca.dot(omega, link.inertia @ omega)) / 2
        force = hessian_force(kinetic, s.q, s.rate, s.acceleration)
        return force + weight(link.mass * link.centre, g, s.q)

    @staticmethod
    def bias(end_point: ca.SX, s: JointState) -> ca.SX:
        """q_r'^T H_a q_r' of the three loop constraints, (3,)."""
        hessians = [ca.hessian(end_point[a], s.q)[0] for a in range(3)]
        return ca.vertcat(*(ca.bilin(H, s.rate, s.rate) for H in hessians))


def hessian_force(kinetic: ca.SX, c: ca.SX, rate: ca.SX, acceleration: ca.SX) -> ca.SX:
    """T_c'c' c'' + T_c'c c' - T_c of one body, (m,)."""
    m = c.numel()
    H, gradient = ca.hessian(kinetic, ca.vertcat(c, rate))
    mixed, mass_matrix = H[m:, :m], H[m:, m:]
    return mass_matrix @ acceleration + mixed @ rate - gradient[:m]
