"""Bryant angles and rotation matrices: R = Rx(alpha) Ry(beta) Rz(gamma)."""

from __future__ import annotations

import numpy as np


def bryant_angles(rotation: np.ndarray) -> np.ndarray:
    """alpha, beta, gamma [rad], (F, 3), of rotations (F, 3, 3); continuous from frame to frame.

    beta lies within +-90 degrees; NaN stays NaN.
    """
    R = rotation
    alpha = np.arctan2(-R[:, 1, 2], R[:, 2, 2])
    beta = np.arctan2(R[:, 0, 2], np.hypot(R[:, 0, 0], R[:, 0, 1]))
    gamma = np.arctan2(-R[:, 0, 1], R[:, 0, 0])
    angles = np.column_stack([alpha, beta, gamma])
    known = np.isfinite(angles).all(axis=1)
    angles[known] = np.unwrap(angles[known], axis=0)
    return angles


def rotations(angles: np.ndarray) -> np.ndarray:
    """R = Rx(alpha) Ry(beta) Rz(gamma) of angles [rad], (F, 3): (F, 3, 3)."""
    (ca, cb, cg), (sa, sb, sg) = np.cos(angles.T), np.sin(angles.T)
    rows = [
        [cb * cg, -cb * sg, sb],
        [ca * sg + sa * sb * cg, ca * cg - sa * sb * sg, -sa * cb],
        [sa * sg - ca * sb * cg, sa * cg + ca * sb * sg, ca * cb],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
