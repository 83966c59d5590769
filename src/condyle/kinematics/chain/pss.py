"""PSS: a slider pushed along a rail of the base, then a rod with two ball joints (also PUS).

With d = M - S at home, rail direction a and rod length L, the loop |d - x a| = L is quadratic in
the travel x; its root is the one of home. Forces and rates need one square root.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ...mechanism.chain import NO_BRANCH
from ..moving_base import MovingBase
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


class PSSFamily(RodFamily):
    kind = "PSS"
    axial = "rod.stiffness"
    bodies = ("sliders", "rods")
    ball = ("slider_joint", "slider's joint S")
    joint_unit = "m"
    effort_unit = "N"
    # S is the slider's joint at home.
    padding = ("branch", "mass", "transverse", "axial", "slider")
    shapes = {"S": 3, "axis": 3, **ROD, "slider": 1, "N": 9}

    def derived(self, f: Constants) -> dict[str, ca.SX]:
        axis, rod = unit(f.axis), f.platform - f.base
        return {
            "S": f.base,
            "axis": axis,
            "branch": ca.sign(ca.dot(rod, axis)),
            "slider": f.slider_mass,
            **self.rod_constants(f, "rod", rod),
        }

    tuned = {"slider_mass": ("slider.mass", "of the slider")}

    def margins(self, f: Constants) -> tuple[ca.SX, ca.SX]:
        return ca.SX(1), sine(f.platform - f.base, f.axis) - NO_BRANCH

    standard = {"slider.mass": "kg", **RodFamily.rod_standard("rod")}

    def of_standard(self, c: Constants, p: Constants) -> dict[str, Any]:
        return {"slider": p.slider_mass, **self.rod_of_standard(c, p, "rod")}

    def to_standard(self, f: Constants) -> dict[str, Any]:
        rod = self.rod_to_standard(f, "rod", ca.norm_2(f.platform - f.base))
        return {"slider.mass": f.slider_mass, **rod}

    def drawing(self, chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
        base = np.asarray(chain.base, dtype=float)
        axis = np.asarray(chain.axis) / np.linalg.norm(chain.axis)
        travel = joint[np.isfinite(joint)]
        spare = 0.2 * np.linalg.norm(np.subtract(chain.platform, base))
        low, high = travel.min(initial=0.0) - spare, travel.max(initial=0.0) + spare
        points = {
            "rail_start": base + low * axis,
            "rail_end": base + high * axis,
            "S": base + joint[:, None] * axis,
            "M": M,
        }
        rods = (
            DrawnRod("rail", "rail_start", "rail_end", 0.8, moving=False),
            DrawnRod("rod", "S", "M"),
        )
        return ChainDrawing(points, rods, ("S", "M"))

    def tip(self, c: Constants, q_r: ca.SX) -> ca.SX:
        return c.S + q_r[0] * c.axis

    def driven(self, c: Constants, q_r: ca.SX) -> tuple[Link, Joint]:
        S = self.tip(c, q_r)
        link = Link("sliders", c.slider, S, ca.SX(3, 3), ca.SX(3, 3))
        return link, Joint.slide("rail", "slider's joint S", S, c.axis)

    def loop(self, c: Constants, M: ca.SX) -> ChainLoop:
        x, root, e, e_a = self._close(c, M)
        J = e / (e_a + (1 - c.branch**2))  # a lane without a chain has branch 0, and no 0 / 0
        return ChainLoop.of(
            c.N, x, e, c.L, discriminant=root / c.L**2, J=J, J_A=-2 * e_a, J_A_scale=2 * c.L
        )

    def dynamics(
        self, c: Constants, M: ca.SX, V: ca.SX, A: ca.SX, g: ca.SX, cut: Cut = ca.SX
    ) -> ChainDynamics:
        _, root, e, _ = self._close(c, M)
        inverse = c.branch * (1 / ca.sqrt(root))  # 1 / e.a
        J = e * inverse
        rate = ca.dot(J, V)
        e_rate = V - c.axis * rate
        # e.(A - a x'') + |e'|^2 = 0
        acceleration = cut(ca.dot(J, A) + ca.dot(e_rate, e_rate) * inverse)
        S_acceleration = c.axis * acceleration

        m_SM, m_SS, axial = self.rod_inertias(c, e, e_rate, A - S_acceleration)
        # m (1 - com) = m_SM + m_SS splits the weight that the slider carries.
        return ChainDynamics(
            forces={"rods": m_SM * S_acceleration - m_SM * g + axial},
            J=J,
            discriminant=root / c.L**2,
            rate=rate,
            acceleration=acceleration,
            efforts={
                "sliders": -c.slider * ca.dot(c.axis, g),
                "rods": ca.dot(c.axis, m_SM * A - axial) - (m_SM + m_SS) * ca.dot(c.axis, g),
            },
            inertias={"sliders": c.slider, "rods": m_SS},
            end_masses=self.end_masses(c),
            upright=self.upright(c, e),
        )

    def tangent(self, c: Constants, S: ca.SX) -> ca.SX:
        return c.axis

    def carried_effort(
        self, c: Constants, S: ca.SX, S_rate: ca.SX, tangent: ca.SX, base: MovingBase
    ) -> ca.SX:
        return c.slider * ca.dot(tangent, base.acceleration(S, S_rate))

    def explain(self, chain: Any, pose: np.ndarray) -> str:
        across, length = self.span(chain, pose)
        return (
            f'chain "{chain.name}" cannot reach M: its rail passes M at {across * 1e3:.1f} mm, '
            f"the rod is {length * 1e3:.1f} mm long"
        )

    def span(self, chain: Any, pose: np.ndarray) -> tuple[float, float]:
        c = self.constants(chain)
        d = joint_position(chain, pose) - c["S"]
        return float(np.linalg.norm(d - (d @ c["axis"]) * c["axis"])), float(c["L"])

    @staticmethod
    def _close(c: Constants, M: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """Travel x, (e.a)^2, rod vector e and e.a."""
        d = M - c.S
        along = ca.dot(d, c.axis)
        root = along * along - ca.dot(d, d) + c.L**2
        e_a = c.branch * (root * (1 / ca.sqrt(root)))  # shares the dynamics's inverse root
        x = along - e_a
        return x, root, d - x * c.axis, e_a
