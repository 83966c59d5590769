"""Base classes of families with rods: a rod of constant length, and a line of variable length."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

import casadi as ca

from ..moving_base import MovingBase
from .family import (
    ChainLoop,
    Constants,
    Family,
    GivingChain,
    Joint,
    Link,
    axial_force,
    carried_moment,
    rod_direction,
    rod_frame,
    rod_guide,
    rod_inertia,
    rod_masses,
    rod_spin,
    spin_energy,
)

# Constants of every rod: N is N_i0 and Y its second axis; `branch` is that of home.
ROD_NUMBERS = ("mass", "com", "transverse", "axial")  # of the file
STANDARD = ("mass", "moment", "inertia", "axial")  # about the joint S, along the rod
ROD = {"L": 1, "branch": 1, "Y": 3, "mass": 1, "com": 1, "transverse": 1, "axial": 1}


class RodFamily(Family):
    """A driven link of the base, and a rod of constant length with ball joints S on it and M."""

    ball: ClassVar[tuple[str, str]]  # name and place of the joint S

    @staticmethod
    def rod_standard(rod: str) -> dict[str, str]:
        """Numbers of `standard` of a rod: inertia is about S, and axial. Args: rod: its table."""
        units = {"mass": "kg", "moment": "kg m", "inertia": "kg m^2", "axial": "kg m^2"}
        return {f"{rod}.{name}": unit for name, unit in units.items()}

    @staticmethod
    def rod_of_standard(c: Constants, p: Constants, rod: str) -> dict[str, Any]:
        mass, moment, inertia, axial = (getattr(p, f"{rod}_{name}") for name in STANDARD)
        com = moment / (mass * c.L)
        return {
            "mass": mass,
            "com": com,
            "transverse": inertia - moment * (com * c.L),
            "axial": axial,
        }

    @staticmethod
    def rod_to_standard(f: Constants, rod: str, length: ca.SX) -> dict[str, Any]:
        mass, com, transverse, axial = (getattr(f, f"{rod}_{name}") for name in ROD_NUMBERS)
        arm = com * length
        found = (mass, mass * arm, transverse + mass * arm**2, axial)
        return {f"{rod}.{name}": value for name, value in zip(STANDARD, found, strict=True)}

    @abstractmethod
    def tip(self, c: Constants, q_r: ca.SX) -> ca.SX:
        """S, (3,)."""

    @abstractmethod
    def driven(self, c: Constants, q_r: ca.SX) -> tuple[Link, Joint]:
        """The link that the actuator drives, and its joint."""

    @staticmethod
    def rod_constants(f: Constants, rod: str, line: ca.SX) -> dict[str, ca.SX]:
        """Constants of `ROD` but the branch, and N. Args: rod: its table;  line: S to M at home."""
        N = rod_frame(line)
        bodies = {name: getattr(f, f"{rod}_{name}") for name in ROD_NUMBERS}
        return {"L": ca.norm_2(line), "Y": N[:, 1], **bodies, "N": N}

    def end_point(self, c: Constants, q_r: ca.SX) -> ca.SX:
        return self.tip(c, q_r) + c.L * rod_direction(c.N, q_r)

    def links(self, c: Constants, q_r: ca.SX) -> list[Link]:
        n = rod_direction(c.N, q_r)
        centre, inertia = self.tip(c, q_r) + c.com * c.L * n, rod_inertia(n, c.transverse, c.axial)
        rod = Link(self.bodies[1], c.mass, centre, rod_spin(c.N, q_r), inertia)
        return [self.driven(c, q_r)[0], rod]

    def joints(self, c: Constants, q_r: ca.SX) -> list[Joint]:
        ball = Joint.ball(*self.ball, self.tip(c, q_r), rod_guide(c.N, q_r))
        return [self.driven(c, q_r)[1], ball]

    def end_masses(self, c: Constants) -> dict[str, ca.SX]:
        return {self.bodies[1]: rod_masses(c.mass, c.com, c.transverse, c.L)[0]}

    def giving(self, c: Constants, M: ca.SX, joint: ca.SX, V: ca.SX, rate: ca.SX) -> GivingChain:
        """The rod stretches evenly: a point of it moves in proportion with its ends."""
        q_r = ca.vertcat(joint, 0, 0)
        driven, S = self.driven(c, q_r)[0], self.tip(c, q_r)
        e, S_rate = M - S, self.tangent(c, S) * rate
        centre, turn = ca.jacobian(driven.centre, joint) * rate, driven.spin[:, 0] * rate
        m_MM, m_SM, m_SS = rod_masses(c.mass, c.com, c.transverse, c.L)
        squares = (
            m_MM * ca.dot(V, V)
            + 2 * m_SM * ca.dot(S_rate, V)
            + m_SS * ca.dot(S_rate, S_rate)
            + driven.mass * ca.dot(centre, centre)
            + ca.dot(turn, driven.inertia @ turn)
        )
        return GivingChain(
            stretch=ca.norm_2(e) - c.L,
            kinetic=squares / 2 + spin_energy(e, V - S_rate, c.Y, c.axial),
            height=driven.mass * driven.centre + c.mass * (S + c.com * e),
        )

    @abstractmethod
    def tangent(self, c: Constants, S: ca.SX) -> ca.SX:
        """dS / d joint, (3,)."""

    @abstractmethod
    def carried_effort(
        self, c: Constants, S: ca.SX, S_rate: ca.SX, tangent: ca.SX, base: MovingBase
    ) -> ca.SX:
        """What a moving base adds to the effort of the driven link."""

    def carried(self, c: Constants, M: ca.SX, V: ca.SX, base: MovingBase) -> ca.SX:
        chain = self.dynamics(c, M, V, ca.SX.zeros(3), ca.SX.zeros(3))
        e = self.loop(c, M).rod
        S = M - e
        t = self.tangent(c, S)
        S_rate = t * chain.rate
        e_rate = V - S_rate
        force = c.mass * base.acceleration(S + c.com * e, S_rate + c.com * e_rate)
        swing = carried_moment(e, e_rate, c.Y, c.transverse, c.axial, base, 1 / c.L)
        effort = ca.dot(t, (1 - c.com) * force - swing)
        effort += self.carried_effort(c, S, S_rate, t, base)
        return c.com * force + swing + chain.J * effort

    @staticmethod
    def upright(c: Constants, e: ca.SX) -> ca.SX:
        """cos(gamma_i)^2 of the rod vector e."""
        sine = ca.dot(c.Y / c.L, e)
        return 1 - sine * sine

    @staticmethod
    def rod_inertias(
        c: Constants, e: ca.SX, e_rate: ca.SX, e_acceleration: ca.SX
    ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """m_SM, m_SS and the force of the axial inertia, at a motion of the rod vector e."""
        _, m_SM, m_SS = rod_masses(c.mass, c.com, c.transverse, c.L)
        return m_SM, m_SS, axial_force(e, e_rate, e_acceleration, c.Y, c.L, c.axial)


class LineFamily(Family):
    """A straight line from B on the base to M; its length |M - B| closes no loop.

    sign: of the joint coordinate in the length, home + sign joint.
    """

    joint_unit = "m"
    effort_unit = "N"
    sign: ClassVar[int]

    def derived(self, f: Constants) -> dict[str, ca.SX]:
        line = f.platform - f.base
        N = rod_frame(line)
        return {"B": f.base, "home": ca.norm_2(line), "present": ca.SX(1), "Y": N[:, 1], "N": N}

    def end_point(self, c: Constants, q_r: ca.SX) -> ca.SX:
        return c.B + (c.home + self.sign * q_r[0]) * rod_direction(c.N, q_r)

    def giving(self, c: Constants, M: ca.SX, joint: ca.SX, V: ca.SX, rate: ca.SX) -> GivingChain:
        """Without bodies."""
        stretch = ca.norm_2(M - c.B) - (c.home + self.sign * joint)
        return GivingChain(stretch, ca.SX(0), ca.SX.zeros(3))

    def loop(self, c: Constants, M: ca.SX) -> ChainLoop:
        e = M - c.B
        r = ca.norm_2(e)
        return ChainLoop.of(
            c.N,
            r - c.home if self.sign > 0 else c.home - r,
            e,
            r,
            discriminant=ca.dot(e, e) / c.home**2,  # it reaches everywhere
            J=self.sign * e / r,
            J_A=-2 * self.sign * r,
            J_A_scale=2 * r,
        )
