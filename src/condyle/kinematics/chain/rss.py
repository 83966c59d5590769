"""RSS: a crank turned by a base-mounted actuator, then a coupler with two ball joints.

With d = M - G, crank length l, coupler length L and two perpendicular unit vectors of the crank
plane, the loop |M - S| = L is one equation a cos + b sin = k in the crank angle, so that
sines, cosines, rates and forces need no arc functions ([Cheng2023] Section 3.2 and eqs 33-40).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ...mechanism.bodies import cross
from ..rotation import rotation_z
from .family import (
    ChainDynamics,
    Constants,
    Cut,
    Family,
    Joint,
    Link,
    Loop,
    axial_force,
    joint_position,
    rod_angles,
    rod_direction,
    rod_frame,
    rod_guide,
    rod_inertia,
    rod_masses,
    rod_spin,
)

LEVEL = 1e-15  # sine of a shaft's tilt below which its crank plane is plane_1 to rounding


class RSSFamily(Family):
    kind = "RSS"
    bodies = ("cranks", "couplers")
    joint_unit = "rad"
    effort_unit = "N m"
    # `plane_1` and `plane_2` span the crank plane; plane_1[2] = 0 saves a constant.
    # C and N are C_i0 and N_i0; Y is the second axis of N.
    padding = ("branch", "mass", "transverse", "axial", "crank")
    shapes = {
        "G": 3,
        "plane_1": 2,
        "plane_2": 3,
        "l": 1,
        "L": 1,
        "branch": 1,
        "Y": 3,
        "mass": 1,
        "com": 1,
        "transverse": 1,
        "axial": 1,
        "crank": 1,
        "C": 9,
        "N": 9,
    }

    def constants(self, chain: Any) -> dict[str, np.ndarray]:
        crank = np.subtract(chain.crank_tip, chain.base)
        coupler = np.subtract(chain.platform, chain.crank_tip)
        x = crank / np.linalg.norm(crank)
        z = np.asarray(chain.axis) - np.dot(chain.axis, x) * x
        z /= np.linalg.norm(z)
        y = cross(z, x)
        plane_1 = np.array([-z[1], z[0]])
        size = np.linalg.norm(plane_1)
        plane_1 = plane_1 / size if size > LEVEL else np.array([1.0, 0.0])
        if size <= LEVEL:
            z = np.array([0.0, 0.0, np.sign(z[2])])  # the crank plane is plane_1 to rounding
        N = rod_frame(coupler)
        values = {
            "G": chain.base,
            "plane_1": plane_1,
            "plane_2": cross(z, [*plane_1, 0.0]),
            "l": np.linalg.norm(crank),
            "L": np.linalg.norm(coupler),
            "branch": -np.sign(coupler @ y),
            "Y": N[:, 1],
            "mass": chain.coupler.mass,
            "com": chain.coupler.com,
            "transverse": chain.coupler.transverse,
            "axial": chain.coupler.axial,
            "crank": chain.crank.inertia,
            "C": np.column_stack([x, y, z]),
            "N": N,
        }
        return {name: np.asarray(value, dtype=float) for name, value in values.items()}

    def end_point(self, c: Constants, q_r: ca.SX) -> ca.SX:
        return self._crank_tip(c, q_r) + c.L * rod_direction(c.N, q_r)

    def links(self, c: Constants, q_r: ca.SX) -> list[Link]:
        n = rod_direction(c.N, q_r)
        Z_C = c.C[:, 2]
        crank_spin = ca.horzcat(Z_C, ca.SX(3, 2))
        return [
            # The crank's mass centre is on its shaft, so its mass never matters (eq. 39).
            Link("cranks", ca.SX(0), c.G, crank_spin, c.crank * (Z_C @ Z_C.T)),
            Link(
                "couplers",
                c.mass,
                self._crank_tip(c, q_r) + c.com * c.L * n,
                rod_spin(c.N, q_r),
                rod_inertia(n, c.transverse, c.axial),
            ),
        ]

    def joints(self, c: Constants, q_r: ca.SX) -> list[Joint]:
        return [
            Joint.shaft("shaft", "crank pivot G", c.G, c.C[:, 2]),
            Joint.ball("crank_tip", "crank tip S", self._crank_tip(c, q_r), rod_guide(c.N, q_r)),
        ]

    def loop(self, c: Constants, M: ca.SX) -> Loop:
        d = M - c.G
        a, b = ca.dot(d, c.C[:, 0]), ca.dot(d, c.C[:, 1])
        k = (ca.dot(d, d) + c.l**2 - c.L**2) / (2 * c.l)
        h = a * a + b * b
        root = h - k * k
        s = c.branch * ca.sqrt(root)
        cosine, sine = (a * k - b * s) / h, (b * k + a * s) / h
        tangent = c.l * (c.C[:, 1] * cosine - c.C[:, 0] * sine)
        e = d - c.l * (c.C[:, 0] * cosine + c.C[:, 1] * sine)
        e_t = -c.l * s
        beta, gamma, cos_gamma = rod_angles(c.N, e, c.L)
        return Loop(
            q_r=ca.vertcat(ca.atan2(b * k + a * s, a * k - b * s), beta, gamma),
            discriminant=root / c.L**2,
            J=e / ca.dot(e, tangent),
            rod=e,
            rod_length=c.L,
            J_A=-2 * e_t,
            J_A_scale=2 * c.l * c.L,
            cos_gamma=cos_gamma,
        )

    def end_masses(self, c: Constants) -> dict[str, ca.SX]:
        return {"couplers": rod_masses(c.mass, c.com, c.transverse, c.L)[0]}

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

        _, m_SM, m_SS = rod_masses(c.mass, c.com, c.transverse, c.L)
        axial = axial_force(e, e_rate, A - S_acceleration, c.Y, c.L, c.axial)
        # m (1 - com) = m_SM + m_SS splits the weight that the crank carries.
        return ChainDynamics(
            forces={"couplers": m_SM * S_acceleration - m_SM * g + axial},
            J=J,
            discriminant=root * (1 / (c.l * c.L) ** 2),
            rate=rate,
            acceleration=acceleration,
            efforts={"couplers": ca.dot(t, m_SM * A - (m_SM + m_SS) * g - axial)},
            inertias={"cranks": c.crank, "couplers": m_SS * c.l**2},
            end_masses=self.end_masses(c),
        )

    def explain(self, chain: Any, pose: np.ndarray) -> str:
        near, far = self._distances(chain, pose)
        return (
            f'chain "{chain.name}" cannot reach M: its crank tip is {near * 1e3:.1f} to '
            f"{far * 1e3:.1f} mm from M, the coupler is {self._length(chain) * 1e3:.1f} mm long"
        )

    def span(self, chain: Any, pose: np.ndarray) -> tuple[float, float]:
        near, far = self._distances(chain, pose)
        length = self._length(chain)
        return (near if near > length else far), length

    def _length(self, chain: Any) -> float:
        return float(self.constants(chain)["L"])

    def _distances(self, chain: Any, pose: np.ndarray) -> tuple[float, float]:
        """Least and largest distance of the crank tip from M, over a turn of the crank [m]."""
        c = self.constants(chain)
        d = joint_position(chain, pose) - c["G"]
        across, along = np.linalg.norm(c["C"][:, :2].T @ d), c["C"][:, 2] @ d
        near, far = np.hypot(across - c["l"], along), np.hypot(across + c["l"], along)
        return float(near), float(far)

    @staticmethod
    def _crank_tip(c: Constants, q_r: ca.SX) -> ca.SX:
        return c.G + (c.C @ rotation_z(ca.cos(q_r[0]), ca.sin(q_r[0])))[:, 0] * c.l
