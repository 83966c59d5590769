"""Points of a contact's surface: their normals, and heights over a grid by Newton's method."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from .batch import evaluate

STEPS = 40


def surface_phi(surface: Any) -> ca.Function:
    """(p) -> phi [m] and its gradient, (3,), at a point (3,) [m]."""
    p = ca.SX.sym("p", 3)
    return ca.Function("phi", [p], [surface.phi(p), surface.gradient(p)])


def surface_heights(
    surface: Any, home: Any, frame: np.ndarray, flat: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Heights of a surface over grid coordinates, (N, 2) [m], and the last steps, (N,) [m].

    Args: home: origin of the grid, (3,) [m];  frame: rows u, v along the grid, and w upwards.
    """
    phi, start = surface_phi(surface), np.asarray(home) + flat @ frame[:2]
    height = np.zeros(len(flat))
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            value, gradient = evaluate(phi, start + height[:, None] * frame[2])
            step = value[:, 0] / (gradient @ frame[2])
            height = height - step
    return height, np.abs(step)
