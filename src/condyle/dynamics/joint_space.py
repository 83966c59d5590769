"""Chains in their joint space q_r = (joint, beta_i, gamma_i) ([Cheng2023] eqs 15-18, 59).

    M_1 q_r' = M',   q_r'' = M_1^-1 (M'' - M_1' q_r'),

and a force f_r dual to q_r' is worth M_1^-T f_r on M. With M' = M_2 c', that is M_3^T f_r on the
coordinates, M_3 = M_1^-1 M_2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from ..kinematics.chain import Constants, Family, Law, Link
from ..kinematics.contact import solve_small
from ..kinematics.state import PointMotion


@dataclass(frozen=True)
class JointState:
    """Symbols q_r, q_r', q_r'' and the time derivative of what is written in them."""

    q: ca.SX
    rate: ca.SX
    acceleration: ca.SX

    def time_derivative(self, expression: ca.SX) -> ca.SX:
        return ca.jtimes(expression, self.q, self.rate) + ca.jtimes(
            expression, self.rate, self.acceleration
        )


LinkForce = Callable[[Link, JointState, ca.SX], ca.SX]


def joint_space_law(
    family: Family, c: Constants, M: PointMotion, g: ca.SX, link_force: LinkForce
) -> Law:
    """The law of a chain whose links' forces are derived in joint space.

    Args: link_force: (link, joint state, gravity) -> force dual to q_r', (3,).
    """
    s = JointState(*(ca.SX.sym(name, 3) for name in ("q_r", "q_r1", "q_r2")))
    tip = family.tip(c, s.q)
    M_1 = ca.jacobian(tip, s.q)
    bias = ca.jtimes(M_1 @ s.rate, s.q, s.rate)
    links = family.links(c, s.q)
    forces = [link_force(link, s, g) for link in links]

    loop = family.loop(c, M.position)
    M_1, bias_of, *forces_of = _at(s, loop.q_r, [M_1, bias, *forces])
    M_1_inverse = solve_small(M_1, ca.SX.eye(3))
    rate = M_1_inverse @ M.velocity
    bias_of = ca.substitute(bias_of, s.rate, rate)
    acceleration = M_1_inverse @ (M.acceleration - bias_of)
    symbols = ca.vertcat(s.rate, s.acceleration)
    values = ca.vertcat(rate, acceleration)
    on_M = {
        link.name: M_1_inverse.T @ ca.substitute(force, symbols, values)
        for link, force in zip(links, forces_of, strict=True)
    }
    return Law(on_M, M_1_inverse[0, :].T, loop.reach, rate[0], acceleration[0])


def _at(s: JointState, q_r: ca.SX, expressions: list[ca.SX]) -> list[ca.SX]:
    return ca.substitute(expressions, [s.q], [q_r])
