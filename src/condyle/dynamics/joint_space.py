"""Chains in their joint space q_r = (joint, beta_i, gamma_i) ([Cheng2023] eqs 15-18, 59).

    M_1 q_r' = M',   q_r'' = M_1^-1 (M'' - M_1' q_r'),

and a force f_r dual to q_r' acts as M_1^-T f_r on M. With M' = M_2 c', that is M_3^T f_r on the
coordinates, M_3 = M_1^-1 M_2.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from ..kinematics.chain import ChainDynamics, ChainLoop, Constants, Family, Link
from ..kinematics.constraints import solve_small
from ..kinematics.moving_base import MovingBase
from ..kinematics.state import PointMotion
from .formulation import Formulation


@dataclass(frozen=True)
class JointState:
    """Symbols q_r, q_r', q_r'' and the time derivative of expressions in them."""

    q: ca.SX
    rate: ca.SX
    acceleration: ca.SX

    @staticmethod
    def symbols() -> JointState:
        return JointState(*(ca.SX.sym(name, 3) for name in ("q_r", "q_r1", "q_r2")))

    def time_derivative(self, expression: ca.SX) -> ca.SX:
        return ca.jtimes(expression, self.q, self.rate) + ca.jtimes(
            expression, self.rate, self.acceleration
        )


@dataclass(frozen=True)
class JointMotion:
    """q_r, q_r' and q_r'' that a motion of M implies, and M_1^-1."""

    loop: ChainLoop
    rate: ca.SX
    acceleration: ca.SX
    inverse: ca.SX

    def insert(self, s: JointState, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Expressions in the symbols `s`, at this motion."""
        if not expressions:  # of a family without bodies
            return []
        symbols = [s.q, s.rate, s.acceleration]
        values = [self.loop.q_r, self.rate, self.acceleration]
        return ca.substitute(list(expressions), symbols, values)

    def dynamics(self, forces: dict[str, ca.SX]) -> ChainDynamics:
        """The dynamics of a chain whose links need `forces`, dual to q_r', (3,) each."""
        on_M = {name: self.inverse.T @ force for name, force in forces.items()}
        J = self.inverse[0, :].T
        loop, motion = self.loop, (self.rate[0], self.acceleration[0])
        return ChainDynamics(on_M, J, loop.discriminant, *motion, upright=loop.upright)


def chain_jacobians(family: Family, c: Constants, q_r: ca.SX) -> tuple[ca.SX, ca.SX]:
    """M_1, (3, 3), with M' = M_1 q_r', and its inverse ([Cheng2023] eqs 16, 17)."""
    q = ca.SX.sym("q_r", 3)
    M_1 = ca.substitute(ca.jacobian(family.end_point(c, q), q), q, q_r)
    return M_1, solve_small(M_1, ca.SX.eye(3))


Bias = Callable[[ca.SX, JointState], ca.SX]


def rate_bias(end_point: ca.SX, s: JointState) -> ca.SX:
    """M_1' q_r', (3,), by the derivative of M_1 along the motion."""
    return ca.jtimes(ca.jacobian(end_point, s.q) @ s.rate, s.q, s.rate)


def joint_motion(
    family: Family, c: Constants, M: PointMotion, bias: Bias = rate_bias
) -> JointMotion:
    """Joint motion of a chain. Args: bias: (end_point, joint state) -> M_1' q_r', (3,)."""
    s = JointState.symbols()
    end_point = family.end_point(c, s.q)
    loop = family.loop(c, M.position)
    M_1, left = ca.substitute([ca.jacobian(end_point, s.q), bias(end_point, s)], [s.q], [loop.q_r])
    inverse = solve_small(M_1, ca.SX.eye(3))
    rate = inverse @ M.velocity
    acceleration = inverse @ (M.acceleration - ca.substitute(left, s.rate, rate))
    return JointMotion(loop, rate, acceleration, inverse)


class JointSpace(Formulation):
    """Formulations whose forces on links are derived in joint space."""

    bias = staticmethod(rate_bias)

    @abstractmethod
    def link_force(self, link: Link, s: JointState, g: ca.SX) -> ca.SX:
        """Inertia less gravity of one moving link, dual to q_r', (3,)."""

    def chain(self, family: Family, c: Constants, M: PointMotion, g: ca.SX) -> ChainDynamics:
        s = JointState.symbols()
        links = family.links(c, s.q)
        motion = joint_motion(family, c, M, self.bias)
        forces = motion.insert(s, [self.link_force(link, s, g) for link in links])
        return motion.dynamics({link.name: f for link, f in zip(links, forces, strict=True)})

    def carried_chain(
        self, family: Family, c: Constants, M: PointMotion, base: MovingBase
    ) -> ca.SX:
        s, force = JointState.symbols(), ca.SX.zeros(3)
        for link in family.links(c, s.q):
            J_E, omega = ca.jacobian(link.centre, s.q), link.spin @ s.rate
            force += J_E.T @ (link.mass * base.acceleration(link.centre, J_E @ s.rate))
            force += link.spin.T @ base.moment(link.inertia, omega)
        motion = joint_motion(family, c, M, self.bias)
        return motion.inverse.T @ motion.insert(s, [force])[0]


def weight(height: ca.SX, g: ca.SX, c: ca.SX) -> ca.SX:
    """Gradient of a body's potential in coordinates c, (m,): gravity's force, negative.

    Args: height: mass times the place of the mass centre, (3,) [kg m].
    """
    return ca.gradient(-ca.dot(g, height), c)
