"""Lagrange-D'Alembert with Jacobian and Hessian matrices, [27] of [Cheng2023] (Abo-Shanab 2020).

Bodies and constraints each give one Jacobian and one Hessian, and nothing is differentiated by
time. The kinetic energy T(c, c') of a body has the Hessian

    [ T_cc    T_cc'  ]
    [ T_c'c   T_c'c' ],    inertia force = T_c'c' c'' + T_c'c c' - T_c,

with the mass matrix T_c'c'. The loop constraints f = end_point(q_r) - M = 0 of a chain have the
Jacobian M_1 = d end_point / d q_r and, one for each component a, a Hessian H_a, so that

    q_r'  = M_1^-1 M',    q_r'' = M_1^-1 (M'' - [q_r'^T H_a q_r']_a).

By D'Alembert a force f_r dual to q_r' is worth M_1^-T f_r on M. [Cheng2023] names this form as
future work and does not print it: what stands here follows from its title.
"""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from ..kinematics.chain import ChainDynamics, Constants, Family, Link
from ..kinematics.state import PointMotion, State
from .formulation import Body
from .joint_space import JointState, joint_space_dynamics


class Hessian:
    name: ClassVar[str] = "hessian"
    uses_twist: ClassVar[bool] = False
    lumps: ClassVar[bool] = False
    pads: ClassVar[bool] = False

    def platform(self, state: State, body: Body, g: ca.SX) -> ca.SX:
        V, omega_M = state.twist[:3], state.R.T @ state.twist[3:]
        kinetic = (body.mass * ca.dot(V, V) + ca.dot(omega_M, body.inertia @ omega_M)) / 2
        potential = -body.mass * ca.dot(g, state.pose[:3])
        c = state.coordinates
        return hessian_force(kinetic, potential, c, state.rate, state.acceleration)

    def chain(self, family: Family, c: Constants, M: PointMotion, g: ca.SX) -> ChainDynamics:
        return joint_space_dynamics(family, c, M, g, link_force, constraint_bias)


def constraint_bias(end_point: ca.SX, s: JointState) -> ca.SX:
    """q_r'^T H_a q_r' of the three loop constraints, (3,)."""
    hessians = [ca.hessian(end_point[a], s.q)[0] for a in range(3)]
    return ca.vertcat(*(ca.bilin(H, s.rate, s.rate) for H in hessians))


def link_force(link: Link, s: JointState, g: ca.SX) -> ca.SX:
    """One moving link, dual to q_r', (3,)."""
    V, omega = ca.jacobian(link.centre, s.q) @ s.rate, link.spin @ s.rate
    kinetic = (link.mass * ca.dot(V, V) + ca.dot(omega, link.inertia @ omega)) / 2
    potential = -link.mass * ca.dot(g, link.centre)
    return hessian_force(kinetic, potential, s.q, s.rate, s.acceleration)


def hessian_force(
    kinetic: ca.SX, potential: ca.SX, c: ca.SX, rate: ca.SX, acceleration: ca.SX
) -> ca.SX:
    """T_c'c' c'' + T_c'c c' - T_c of one body, and the gradient of its potential, (m,)."""
    m = c.numel()
    H, gradient = ca.hessian(kinetic, ca.vertcat(c, rate))
    mixed, mass_matrix = H[m:, :m], H[m:, m:]
    return mass_matrix @ acceleration + mixed @ rate - gradient[:m] + ca.gradient(potential, c)
