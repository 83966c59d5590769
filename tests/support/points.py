"""Points of a platform, by rotations written anew."""

from __future__ import annotations

import numpy as np


def moved(pose: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Displacement from home of a point p of the platform at a pose; R = Rx Ry Rz."""
    (a, b, c), turned = pose[3:], p
    turned = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]]) @ turned
    turned = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]]) @ turned
    turned = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]) @ turned
    return pose[:3] + turned - p
