"""Bounds of contacts, and the loss of unilateral ones."""

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


def contact_loss(mechanism: Mechanism, force: np.ndarray) -> np.ndarray:
    """Whether unilateral contacts would have to pull, (N, k), at contact forces (N, k)."""
    push = np.array([c.push if c.one_sided else 0 for c in mechanism.contacts], dtype=float)
    if not push.any():
        return np.zeros(force.shape, dtype=bool)
    return push * force < -FORCE_TOLERANCE


def contact_loss_columns(mechanism: Mechanism, lost: np.ndarray) -> dict[str, np.ndarray]:
    """Columns contact_loss_<contact>, 0 or 1, of the unilateral contacts."""
    return {
        f"contact_loss_{contact.name}": lost[:, i].astype(int)
        for i, contact in enumerate(mechanism.contacts)
        if contact.one_sided
    }
