"""The six coordinates of the platform, X_EE of [Cheng2023], and its rotation in numbers.

Bryant angles: R = Rx(alpha) Ry(beta) Rz(gamma).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

Coordinate = Literal["X", "Y", "Z", "alpha", "beta", "gamma"]
COORDINATES = ("X", "Y", "Z", "alpha", "beta", "gamma")


def rotations(angles: np.ndarray) -> np.ndarray:
    """R, (..., 3, 3), of angles (..., 3) [rad]."""
    (ca, cb, cg), (sa, sb, sg) = (np.moveaxis(f(angles), -1, 0) for f in (np.cos, np.sin))
    rows = [
        [cb * cg, -cb * sg, sb],
        [ca * sg + sa * sb * cg, ca * cg - sa * sb * sg, -sa * cb],
        [sa * sg - ca * sb * cg, sa * cg + ca * sb * sg, ca * cb],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def bryant_angles(R: np.ndarray) -> np.ndarray:
    """alpha, beta, gamma, (..., 3) [rad], of rotations (..., 3, 3); beta within +-90 degrees."""
    alpha = np.arctan2(-R[..., 1, 2], R[..., 2, 2])
    beta = np.arctan2(R[..., 0, 2], np.hypot(R[..., 0, 0], R[..., 0, 1]))
    return np.stack([alpha, beta, np.arctan2(-R[..., 0, 1], R[..., 0, 0])], axis=-1)
