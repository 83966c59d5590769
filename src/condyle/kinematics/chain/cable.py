"""Cable: a straight massless line from the base to the platform, which can only pull.

Its length r = |M - B| closes no loop: the joint coordinate is what was wound up, home length minus
length, so that the tension is the effort and its power effort times joint rate. With e = M - B and
u = e / r the actuator's row is J = -u: tension pulls the platform towards the base. There is
nothing between the two points, so the chain has no bodies, and no reaction but its pull.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from .family import (
    ChainDynamics,
    Constants,
    Cut,
    Family,
    Joint,
    Link,
    Loop,
    rod_angles,
    rod_direction,
    rod_frame,
)


class CableFamily(Family):
    kind = "cable"
    bodies = ()
    joint_unit = "m"
    effort_unit = "N"
    padding = ("present",)  # 1; at 0 the cable has no row
    shapes = {"B": 3, "home": 1, "present": 1, "N": 9}

    def constants(self, chain: Any) -> dict[str, np.ndarray]:
        line = np.subtract(chain.platform, chain.base)
        values = {
            "B": chain.base,
            "home": np.linalg.norm(line),
            "present": 1.0,
            "N": rod_frame(line),
        }
        return {name: np.asarray(value, dtype=float) for name, value in values.items()}

    def end_point(self, c: Constants, q_r: ca.SX) -> ca.SX:
        return c.B + (c.home - q_r[0]) * rod_direction(c.N, q_r)

    def links(self, c: Constants, q_r: ca.SX) -> list[Link]:
        return []

    def joints(self, c: Constants, q_r: ca.SX) -> list[Joint]:
        return []

    def loop(self, c: Constants, M: ca.SX) -> Loop:
        e = M - c.B
        r = ca.norm_2(e)
        beta, gamma, cos_gamma = rod_angles(c.N, e, r)
        return Loop(
            q_r=ca.vertcat(c.home - r, beta, gamma),
            discriminant=ca.dot(e, e) / c.home**2,  # a cable reaches everywhere
            J=-e / r,
            rod=e,
            rod_length=r,
            J_A=2 * r,
            J_A_scale=2 * r,
            cos_gamma=cos_gamma,
        )

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

    def explain(self, chain: Any, pose: np.ndarray) -> str:
        return f'chain "{chain.name}" has no direction: M is where the cable is held'
