"""Closed surfaces of second order, written about one of their own points.

    phi(p) = (p - centre)^T A (p - centre) - level = d^T A d + b . d + e,   d = p - origin.

With an `origin` on the surface no large numbers cancel: a socket of a kilometre's radius is as
exact as its tangent plane, and a small one far from O_M as one at hand.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def about_itself(A: np.ndarray, centre: np.ndarray, level: float) -> tuple[float, ...]:
    """origin (3), b (3), e, and the entries xx, yy, zz, xy, xz, yz of A.

    The origin is where the line from the centre to O_M meets the surface.
    """
    ray = -centre
    if not ray @ A @ ray > 1e-12 * level:
        ray = np.linalg.eigh(A)[1][:, -1]
    origin = centre + ray * np.sqrt(level / (ray @ A @ ray))
    lever = origin - centre
    entries = (A[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return tuple(map(float, (*origin, *(2 * A @ lever), lever @ A @ lever - level, *entries)))


def value(point: Any, c: Any) -> Any:
    """phi at a point (3,)."""
    x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    i = c[7] * x + c[10] * y + c[11] * z + c[3]
    j = c[10] * x + c[8] * y + c[12] * z + c[4]
    k = c[11] * x + c[12] * y + c[9] * z + c[5]
    return x * i + y * j + z * k + c[6]
