"""SPS: a telescopic leg, cylinder and piston, between two ball joints (also UPS).

The leg's length r = |M - B| is the joint coordinate, up to that of home, so there is no loop to
solve: e = M - B, and with u = e / r the actuator's row is u itself. Cylinder and piston share the
leg's direction and turn with N_i0 Ry(beta_i) Rz(gamma_i).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..moving_base import MovingBase
from .chain_drawing import ChainDrawing, DrawnRod
from .family import (
    ChainDynamics,
    Constants,
    Cut,
    GivingChain,
    Joint,
    Link,
    carried_moment,
    rod_direction,
    rod_guide,
    rod_inertia,
    rod_spin,
    spin_energy,
)
from .rod import LineFamily, RodFamily

# Of both bodies; cylinder_com is the distance from B, piston_com that from M, along the leg.
BODIES = [(b, n) for b in ("cylinder", "piston") for n in ("mass", "com", "transverse", "axial")]

BARREL = 0.6  # length of the drawn cylinder over the leg's at home


class SPSFamily(LineFamily):
    kind = "SPS"
    axial = "leg.stiffness"
    bodies = ("cylinders", "pistons")
    sign = 1
    padding = ("present", "piston_mass")  # `present` is 1; at 0 the leg has no row
    shapes = {"B": 3, "home": 1, "present": 1, "Y": 3, **{f"{b}_{n}": 1 for b, n in BODIES}, "N": 9}

    def derived(self, f: Constants) -> dict[str, ca.SX]:
        own = {f"{body}_{name}": getattr(f, f"{body}_{name}") for body, name in BODIES}
        return super().derived(f) | own

    # Each body's inertia is about its own joint: the cylinder's B, the piston's M.
    standard = RodFamily.rod_standard("cylinder") | RodFamily.rod_standard("piston")

    def of_standard(self, c: Constants, p: Constants) -> dict[str, Any]:
        constants: dict[str, Any] = {}
        for body in ("cylinder", "piston"):
            one = RodFamily.rod_of_standard(Constants(L=1), p, body)
            constants |= {f"{body}_{name}": value for name, value in one.items()}
        return constants

    def to_standard(self, f: Constants) -> dict[str, Any]:
        one = ca.SX(1)
        return RodFamily.rod_to_standard(f, "cylinder", one) | RodFamily.rod_to_standard(
            f, "piston", one
        )

    def drawing(self, chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
        base = np.asarray(chain.base, dtype=float)
        home = np.linalg.norm(np.subtract(chain.platform, base))
        leg = M - base
        length = np.linalg.norm(leg, axis=1, keepdims=True)
        points = {"B": base, "barrel": base + leg * (BARREL * home / length), "M": M}
        rods = (DrawnRod("cylinder", "B", "barrel", 2.0), DrawnRod("piston", "barrel", "M"))
        return ChainDrawing(points, rods, ("B", "M"))

    def links(self, c: Constants, q_r: ca.SX) -> list[Link]:
        n, spin = rod_direction(c.N, q_r), rod_spin(c.N, q_r)
        cylinder, piston = (
            rod_inertia(n, c.cylinder_transverse, c.cylinder_axial),
            rod_inertia(n, c.piston_transverse, c.piston_axial),
        )
        return [
            Link("cylinders", c.cylinder_mass, c.B + c.cylinder_com * n, spin, cylinder),
            Link("pistons", c.piston_mass, self.end_point(c, q_r) - c.piston_com * n, spin, piston),
        ]

    def joints(self, c: Constants, q_r: ca.SX) -> list[Joint]:
        return [
            Joint.ball("base_joint", "base joint B", c.B, rod_guide(c.N, q_r)),
            Joint.slide(
                "sleeve", "platform joint M", self.end_point(c, q_r), rod_direction(c.N, q_r)
            ),
        ]

    def giving(self, c: Constants, M: ca.SX, joint: ca.SX, V: ca.SX, rate: ca.SX) -> GivingChain:
        """The piston follows M: it is its drive that the leg's stretch is apart from."""
        e = M - c.B
        n = e / ca.norm_2(e)
        turn = ca.jtimes(n, M, V)
        slide = V - c.piston_com * turn
        across = c.cylinder_mass * c.cylinder_com**2 + c.cylinder_transverse + c.piston_transverse
        squares = across * ca.dot(turn, turn) + c.piston_mass * ca.dot(slide, slide)
        return GivingChain(
            stretch=super().giving(c, M, joint, V, rate).stretch,
            kinetic=squares / 2 + spin_energy(e, V, c.Y, c.cylinder_axial + c.piston_axial),
            height=c.cylinder_mass * (c.B + c.cylinder_com * n)
            + c.piston_mass * (M - c.piston_com * n),
        )

    def end_masses(self, c: Constants) -> dict[str, ca.SX]:
        return {"pistons": c.piston_mass}

    def dynamics(
        self, c: Constants, M: ca.SX, V: ca.SX, A: ca.SX, g: ca.SX, cut: Cut = ca.SX
    ) -> ChainDynamics:
        """Dynamics, w = r u'' across the leg, W = |V|^2 - r'^2 = r^2 |u'|^2 and z = com_piston / r:

        cylinder: (m com^2 + I) w / r^2 - (m com / r) (g across u),
        piston:   m [(1 - z) (A - g - z w) + z (u.(A - g) + W / r) u] + I w / r^2,
        both:     axial [(s^2 beta')' / p  Y x e - s beta'^2 ds/de],

        s = sin(gamma) = Y.e / r, p = r^2 - (Y.e)^2, beta' = (Y x e).V / p, ds/de = (Y - s u) / r.
        J = u, so that forces along u are efforts.
        """
        e = M - c.B
        r2 = ca.dot(e, e)
        inverse = c.present * (1 / ca.sqrt(r2))
        inverse2 = inverse * inverse
        u = e * inverse
        rate = ca.dot(u, V)
        u_A, u_g = ca.dot(u, A), ca.dot(u, g)
        swing = (ca.dot(V, V) - rate * rate) * inverse
        slip = 2 * rate * inverse
        w, w_u = A - slip * V, slip * rate - u_A  # w + w_u u is across the leg

        y, y_rate = ca.dot(c.Y, e), ca.dot(c.Y, V)
        turn = ca.cross(c.Y, e)
        s = y * inverse
        inverse_p = 1 / (r2 - y * y)
        beta_rate = ca.dot(turn, V) * inverse_p
        half_p_rate = rate * (r2 * inverse) - y * y_rate
        beta_acceleration = (ca.dot(turn, A) - 2 * half_p_rate * beta_rate) * inverse_p
        s_rate = (y_rate - s * rate) * inverse
        about_Y = (2 * s * s_rate * beta_rate + s * s * beta_acceleration) * inverse_p
        tilt = s * beta_rate * beta_rate * inverse
        spin, spin_u = about_Y * turn - tilt * c.Y, tilt * s

        about_B = (c.cylinder_mass * c.cylinder_com**2 + c.cylinder_transverse) * inverse2
        arm = c.cylinder_mass * c.cylinder_com * inverse
        z = c.piston_com * inverse
        lag = c.piston_mass * z
        about_M = c.piston_transverse * inverse2 - (c.piston_mass - lag) * z
        return ChainDynamics(
            forces={
                "cylinders": about_B * w - arm * g + c.cylinder_axial * spin,
                "pistons": about_M * w - lag * (A - g) + c.piston_axial * spin,
            },
            J=u,
            discriminant=r2 * (1 / c.home**2),
            rate=rate,
            acceleration=u_A + swing,
            efforts={
                "cylinders": about_B * w_u + arm * u_g + c.cylinder_axial * spin_u,
                "pistons": about_M * w_u + lag * (u_A - u_g + swing) + c.piston_axial * spin_u,
            },
            end_masses=self.end_masses(c),
            upright=(r2 - y * y) * inverse * inverse,
        )

    def carried(self, c: Constants, M: ca.SX, V: ca.SX, base: MovingBase) -> ca.SX:
        e = M - c.B
        inverse = c.present * (1 / ca.norm_2(e))
        u = e * inverse
        across = inverse * (ca.SX.eye(3) - u @ u.T)  # du / dM
        u_rate = across @ V
        at_cylinder = base.acceleration(c.B + c.cylinder_com * u, c.cylinder_com * u_rate)
        at_piston = base.acceleration(M - c.piston_com * u, V - c.piston_com * u_rate)
        pushed, pulled = c.cylinder_mass * at_cylinder, c.piston_mass * at_piston
        turned = across.T @ (c.cylinder_com * pushed - c.piston_com * pulled)
        transverse = c.cylinder_transverse + c.piston_transverse
        axial = c.cylinder_axial + c.piston_axial
        return pulled + turned + carried_moment(e, V, c.Y, transverse, axial, base, inverse)

    def explain(self, chain: Any, pose: np.ndarray) -> str:
        return f'chain "{chain.name}" has no direction: M is at its base joint'
