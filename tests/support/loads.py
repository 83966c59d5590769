"""Loads as arrays (N, 9): wrench [N, N m] in {S} and the point it acts at, in {M}."""

from __future__ import annotations

from typing import Any

import numpy as np

from condyle.model.model import Model
from condyle.motion import resolve_load_point


def with_point(wrench: np.ndarray, point: Any) -> np.ndarray:
    """Wrenches (N, 6) at one point, (3,)."""
    return np.hstack([wrench, np.broadcast_to(point, (len(wrench), 3))])


def parts(load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wrench and point, as models take them."""
    return load[..., :6], load[..., 6:]


def load_point_of(model: Model, name: str | None) -> np.ndarray:
    """Where a load acts: a named point, else right_molar, or the only one."""
    points = model.mechanism.platform.points
    return np.array(points[resolve_load_point(name, points)])
