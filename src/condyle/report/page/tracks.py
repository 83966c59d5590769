"""Tracks of the contact balls on their surfaces, from above and from the side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import contact_profile
from .columns import Columns

if TYPE_CHECKING:
    from ...results.solution import Solution

MILLI = 1e3
VIEWS = {"above": (0, 1), "side": (0, 2)}


def track_panels(solution: Solution, columns: Columns) -> list[dict[str, Any]]:
    """Two plots for each contact: (x, y) and (x, z), in millimetres, with the bounds."""
    points = solution["contact_point"].values
    panels = []
    for i, contact in enumerate(solution.mechanism.contacts):
        numbers = columns.add_vector(f"contact_point.{contact.name}", points[:, i])
        bounds = [contact.bounds.x, contact.bounds.y, contact.bounds.z]
        for view, (across, up) in VIEWS.items():
            panels.append(
                {
                    "id": f"track-{i}-{view}",
                    "contact": contact.name,
                    "view": view,
                    "axes": ["xyz"[across], "xyz"[up]],
                    "columns": [numbers[across], numbers[up]],
                    "scale": MILLI,
                    "bounds": [_scaled(bounds[across]), _scaled(bounds[up])],
                    "profile": _profile(contact, points[:, i]) if view == "side" else None,
                }
            )
    return panels


def _scaled(interval: tuple[float, float] | None) -> list[float] | None:
    return None if interval is None else [value * MILLI for value in interval]


def _profile(contact: Any, track: np.ndarray) -> list[list[float | None]] | None:
    """The surface's line seen from the side, through the home point [mm]."""
    x = track[np.isfinite(track).all(axis=1), 0]
    reach = [*x, contact.point[0], *(contact.bounds.x or ())]
    spare = 0.1 * (max(reach) - min(reach))
    line = contact_profile(contact, min(reach) - spare, max(reach) + spare, contact.point[1])
    if line is None:
        return None
    numbers = (line[:, [0, 2]] * MILLI).T
    return [[float(v) if np.isfinite(v) else None for v in row] for row in numbers]
