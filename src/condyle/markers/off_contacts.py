"""How far a measured pose takes each ball off its surface: what projection will take away."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..mechanism.mechanism import Mechanism


def off_contacts(
    mechanism: Mechanism, rotation: np.ndarray, position: np.ndarray
) -> dict[str, np.ndarray]:
    """Distance of every ball from its surface, by contact, (F,) [m]; along the normal.

    Args: rotation: R of {M} in {S}, (F, 3, 3);  position: of O_M, (F, 3) [m].
    """
    found = {}
    for contact in mechanism.contacts:
        p = ca.SX.sym("p", 3)
        phi = contact.offset_surface.phi(p)
        slope = ca.norm_2(ca.gradient(phi, p))
        distance = ca.Function("distance", [p], [phi / slope]).map(len(position))
        balls = rotation @ np.array(contact.point) + position
        found[contact.name] = np.asarray(distance(balls.T)).ravel()
    return found
