"""Cable: a straight massless line from the base to the platform, which can only pull.

Its length r = |M - B| closes no loop: the joint coordinate is the wound-up length, home length less
length, so that the tension is the effort and its power effort times joint rate. With e = M - B and
u = e / r the actuator's row is J = -u: tension pulls the platform towards the base. The chain has
no bodies, and no reaction but its pull.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..moving_base import MovingBase
from .chain_drawing import ChainDrawing, line_drawing
from .family import ChainDynamics, Constants, Cut, Joint, Link
from .rod import LineFamily


class CableFamily(LineFamily):
    kind = "cable"
    pulls = True
    bodies = ()
    sign = -1
    padding = ("present",)  # 1; at 0 the cable has no row
    shapes = {"B": 3, "home": 1, "present": 1, "N": 9}

    def links(self, c: Constants, q_r: ca.SX) -> list[Link]:
        return []

    def joints(self, c: Constants, q_r: ca.SX) -> list[Joint]:
        return []

    def drawing(self, chain: Any, joint: np.ndarray, M: np.ndarray) -> ChainDrawing:
        """A thin line; where it holds the platform there is no joint to be seen."""
        return line_drawing(chain, M)

    def dynamics(
        self, c: Constants, M: ca.SX, V: ca.SX, A: ca.SX, g: ca.SX, cut: Cut = ca.SX
    ) -> ChainDynamics:
        """No forces but the tension: r'' = u.A + (|V|^2 - r'^2) / r."""
        e = M - c.B
        r2 = ca.dot(e, e)
        inverse = c.present * (1 / ca.sqrt(r2))
        J = -inverse * e
        rate = ca.dot(J, V)
        swing = (ca.dot(V, V) - rate * rate) * inverse
        return ChainDynamics(
            forces={},
            J=J,
            discriminant=r2 * (1 / c.home**2),
            rate=rate,
            acceleration=ca.dot(J, A) - swing,
        )

    def carried(self, c: Constants, M: ca.SX, V: ca.SX, base: MovingBase) -> ca.SX:
        return ca.SX.zeros(3)

    def explain(self, chain: Any, pose: np.ndarray) -> str:
        return f'chain "{chain.name}" has no direction: M is where the cable is held'
