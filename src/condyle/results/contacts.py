"""Bounds of contacts, joint loads, and the loss of unilateral contacts."""

from __future__ import annotations

import numpy as np

from ..mechanism.mechanism import Mechanism
from ..quantities.entries import AXES

BOUND_TOLERANCE = 1e-12  # metres: rounding at a bound is not outside
FORCE_TOLERANCE = 1e-12  # newtons: rounding of no force is not a pull


def bound_margins(mechanism: Mechanism, points: np.ndarray) -> np.ndarray:
    """Distance of contact points, (N, k, 3), to their nearest bound, (N, k); inf without one."""
    margins = np.full(points.shape[:2], np.inf)
    for i, contact in enumerate(mechanism.contacts):
        for axis, name in enumerate(AXES):
            if (interval := getattr(contact.bounds, name)) is not None:
                low, high = interval
                coordinate = points[:, i, axis]
                inside = np.minimum(coordinate - low, high - coordinate)
                np.minimum(margins[:, i], inside, out=margins[:, i])
    return margins


def joint_loads(mechanism: Mechanism, force: np.ndarray) -> np.ndarray:
    """Joint loads at contact forces along the normals, both (..., k) [N]: positive where the
    surface pushes the ball, negative where it pulls; without a `side`, along the normal."""
    return np.array([contact.push or 1 for contact in mechanism.contacts]) * force + 0.0  # no -0


def load_sign(mechanism: Mechanism) -> str:
    """What a positive joint load means, in words."""
    if all(contact.side for contact in mechanism.contacts):
        return "positive: the surface pushes the ball"
    return "positive: along the normal of the surface"


def contact_loss(mechanism: Mechanism, force: np.ndarray) -> np.ndarray:
    """Whether unilateral contacts would have to pull, (N, k), at contact forces (N, k)."""
    one_sided = np.array([contact.one_sided for contact in mechanism.contacts], dtype=bool)
    return one_sided & (joint_loads(mechanism, force) < -FORCE_TOLERANCE)


def contact_loss_columns(mechanism: Mechanism, lost: np.ndarray) -> dict[str, np.ndarray]:
    """Columns contact_loss_<contact>, 0 or 1, of the unilateral contacts."""
    return {
        f"contact_loss_{contact.name}": lost[:, i].astype(int)
        for i, contact in enumerate(mechanism.contacts)
        if contact.one_sided
    }
