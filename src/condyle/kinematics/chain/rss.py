"""RSS: a crank turned by a base-mounted actuator, then a coupler with two ball joints.

With d = M - G, crank length l, coupler length L and two perpendicular unit vectors of the crank
plane, the loop |M - S| = L is one equation a cos + b sin = k in the crank angle, so that
sines, cosines, rates and forces need no arc functions ([Cheng2023] Section 3.2 and eqs 33-40).
"""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np

from ...mechanism.chain import AXIS_TOLERANCE, NO_BRANCH
from ..moving_base import MovingBase
from ..rotation import rotation_z
from .chain_drawing import ChainDrawing, DrawnRod
from .family import (
    ChainDynamics,
    ChainLoop,
    Constants,
    Cut,
    Joint,
    Link,
    joint_position,
    sine,
    unit,
)
from .rod import ROD, RodFamily

LEVEL = 1e-15  # sine of a shaft's tilt below which its crank plane is plane_1 to rounding


class RSSFamily(RodFamily):
    kind = "RSS"
    axial = "coupler.stiffness"
    bodies = ("cranks", "couplers")
    ball = ("crank_tip", "crank tip S")
    joint_unit = "rad"
    effort_unit = "N m"
    # `plane_1` and `plane_2` span the crank plane; plane_1[2] = 0 saves a constant. C is C_i0.
    padding = ("branch", "mass", "transverse", "axial", "crank", "crank_mass")
    shapes = {"G": 3, "plane_1": 2, "plane_2": 3, "l": 1, **ROD}
    shapes |= {"crank": 1, "crank_mass": 1, "crank_com": 1, "C": 9, "N": 9}

    def derived(self, f: Constants) -> dict[str, ca.SX]:
        crank, coupler = f.crank_tip - f.base, f.platform - f.crank_tip
        x = unit(crank)
        z = unit(f.axis - ca.dot(f.axis, x) * x)
        y = ca.cross(z, x)
        size = ca.norm_2(z[:2])
        level = size <= LEVEL
        plane_1 = ca.if_else(level, ca.vertcat(1, 0), ca.vertcat(-z[1], z[0]) / size)
        z = ca.if_else(level, ca.vertcat(0, 0, ca.sign(z[2])), z)
        return {
            "G": f.base,
            "plane_1": plane_1,
            "plane_2": ca.cross(z, ca.vertcat(plane_1, 0)),
            "l": ca.norm_2(crank),
            "branch": -ca.sign(ca.dot(coupler, y)),
            "crank": f.crank_inertia,
            "crank_mass": f.crank_mass,
            "crank_com": f.crank_com,
            "C": ca.horzcat(x, y, z),
            **self.rod_constants(f, "coupler", coupler),
        }

    tuned = {"crank_inertia": ("crank.inertia", "of the crank")}

    def margins(self, f: Constants) -> tuple[ca.SX, ca.SX]:
        crank = f.crank_tip - f.base
        tangent = ca.cross(f.axis, crank)
        axis = math.sin(AXIS_TOLERANCE) - sine(f.axis, crank)
        return axis, sine(f.platform - f.crank_tip, tangent) - NO_BRANCH

    standard = RodFamily.rod_standard("coupler") | {
        "crank.moment": "kg m",
        "crank.inertia": "kg m^2",
    }

    def of_standard(self, c: Constants, p: Constants) -> dict[str, Any]:
        own = {"crank_mass": p.crank_moment, "crank_com": ca.SX(1), "crank": p.crank_inertia}
        return own | self.rod_of_standard(c, p, "coupler")

    def to_standard(self, f: Constants) -> dict[str, Any]:
        own = self.rod_to_standard(f, "coupler", ca.norm_2(f.platform - f.crank_tip))
        return own | {"crank.moment": f.crank_mass * f.crank_com, "crank.inertia": f.crank_inertia}

    def drawing(self, chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
        c = self.constants(chain)
        G, (x, y, z) = np.asarray(c["G"]), np.asarray(c["C"]).T
        crank = np.cos(joint)[:, None] * x + np.sin(joint)[:, None] * y
        shaft = 0.25 * c["l"] * z
        points = {
            "G": G,
            "shaft_start": G - shaft,
            "shaft_end": G + shaft,
            "S": G + c["l"] * crank,
            "M": M,
        }
        rods = (
            DrawnRod("shaft", "shaft_start", "shaft_end", 2.0, moving=False),
            DrawnRod("crank", "G", "S", 1.6),
            DrawnRod("coupler", "S", "M"),
        )
        return ChainDrawing(points, rods, ("S", "M"))

    def tip(self, c: Constants, q_r: ca.SX) -> ca.SX:
        return c.G + (c.C @ rotation_z(ca.cos(q_r[0]), ca.sin(q_r[0])))[:, 0] * c.l

    def driven(self, c: Constants, q_r: ca.SX) -> tuple[Link, Joint]:
        Z_C = c.C[:, 2]
        # In the paper the crank's mass centre is on its shaft, so its mass never matters (eq. 39).
        spin = ca.horzcat(Z_C, ca.SX(3, 2))
        arm = (c.C @ rotation_z(ca.cos(q_r[0]), ca.sin(q_r[0])))[:, 0] * c.crank_com
        central = c.crank - c.crank_mass * c.crank_com**2
        link = Link("cranks", c.crank_mass, c.G + arm, spin, central * (Z_C @ Z_C.T))
        return link, Joint.shaft("shaft", "crank pivot G", c.G, Z_C)

    def loop(self, c: Constants, M: ca.SX) -> ChainLoop:
        d = M - c.G
        a, b = ca.dot(d, c.C[:, 0]), ca.dot(d, c.C[:, 1])
        k = (ca.dot(d, d) + c.l**2 - c.L**2) / (2 * c.l)
        h = a * a + b * b
        root = h - k * k
        s = c.branch * ca.sqrt(root)
        cosine, sine = (a * k - b * s) / h, (b * k + a * s) / h
        tangent = c.l * (c.C[:, 1] * cosine - c.C[:, 0] * sine)
        e = d - c.l * (c.C[:, 0] * cosine + c.C[:, 1] * sine)
        return ChainLoop.of(
            c.N,
            ca.atan2(b * k + a * s, a * k - b * s),
            e,
            c.L,
            discriminant=root / c.L**2,
            # e.t = -branch sqrt(root); a lane without a chain has branch 0, and no 0 / 0.
            J=e / (ca.dot(e, tangent) + (1 - c.branch**2)),
            J_A=2 * c.l * s,
            J_A_scale=2 * c.l * c.L,
        )

    def dynamics(
        self, c: Constants, M: ca.SX, V: ca.SX, A: ca.SX, g: ca.SX, cut: Cut = ca.SX
    ) -> ChainDynamics:
        d = M - c.G
        # Both vectors of the crank plane times l: constants, as all that is made of constants.
        plane_1, plane_2 = c.l * ca.vertcat(c.plane_1[0], c.plane_1[1], 0), c.l * c.plane_2
        a, b = ca.dot(d, plane_1), ca.dot(d, plane_2)
        k = ca.dot(d, d) * 0.5 + (c.l**2 - c.L**2) * 0.5
        h = a * a + b * b
        root = h - k * k
        inverse_h = 1 / h
        inverse_e_t = -c.branch * (1 / ca.sqrt(root))  # t is the tangent, e.t = -branch sqrt(root)
        k_h, s_h = k * inverse_h, root * inverse_e_t * inverse_h
        cosine, sine = a * k_h + b * s_h, b * k_h - a * s_h

        r = cosine * plane_1 + sine * plane_2
        t = cosine * plane_2 - sine * plane_1
        e = d - r
        J = e * inverse_e_t
        rate = ca.dot(J, V)
        e_rate = V - t * rate
        rate2 = rate * rate
        # e.(A - S'') + |e'|^2 = 0 with S'' = t theta'' - r theta'^2 and e.r = k - l^2
        square = ca.dot(e_rate, e_rate) + (k - c.l**2) * rate2
        acceleration = cut(ca.dot(J, A) + square * inverse_e_t)
        S_acceleration = t * acceleration - r * rate2

        m_SM, m_SS, axial = self.rod_inertias(c, e, e_rate, A - S_acceleration)
        # m (1 - com) = m_SM + m_SS splits the weight that the crank carries.
        return ChainDynamics(
            forces={"couplers": m_SM * S_acceleration - m_SM * g + axial},
            J=J,
            discriminant=root * (1 / (c.l * c.L) ** 2),
            rate=rate,
            acceleration=acceleration,
            efforts={
                "cranks": ca.dot(t, g) * (-c.crank_mass * c.crank_com / c.l),
                "couplers": ca.dot(t, m_SM * A - (m_SM + m_SS) * g - axial),
            },
            inertias={"cranks": c.crank, "couplers": m_SS * c.l**2},
            end_masses=self.end_masses(c),
            upright=self.upright(c, e),
        )

    def tangent(self, c: Constants, S: ca.SX) -> ca.SX:
        return ca.cross(c.C[:, 2], S - c.G)

    def carried_effort(
        self, c: Constants, S: ca.SX, S_rate: ca.SX, tangent: ca.SX, base: MovingBase
    ) -> ca.SX:
        part = c.crank_com / c.l
        force = c.crank_mass * base.acceleration(c.G + part * (S - c.G), part * S_rate)
        central = c.crank - c.crank_mass * c.crank_com**2
        return part * ca.dot(tangent, force) + central * ca.dot(c.C[:, 2], base.w_rate)

    def explain(self, chain: Any, pose: np.ndarray) -> str:
        near, far, length = (f"{v * 1e3:.1f}" for v in self._distances(chain, pose))
        return (
            f'chain "{chain.name}" cannot reach M: its crank tip is {near} to {far} mm from M, '
            f"the coupler is {length} mm long"
        )

    def span(self, chain: Any, pose: np.ndarray) -> tuple[float, float]:
        near, far, length = self._distances(chain, pose)
        return (near if near > length else far), length

    def _distances(self, chain: Any, pose: np.ndarray) -> tuple[float, float, float]:
        """The crank tip's distances from M over a turn, least and largest, and L [m]."""
        c = self.constants(chain)
        d = joint_position(chain, pose) - c["G"]
        across, along = np.linalg.norm(c["C"][:, :2].T @ d), c["C"][:, 2] @ d
        near, far = np.hypot(across - c["l"], along), np.hypot(across + c["l"], along)
        return float(near), float(far), float(c["L"])
