"""The freedoms of a point on a surface, as joints: what a surface is to multibody programs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Freedom:
    """A joint: "slide" or "hinge", its unit axis, and the point it turns about, in {S} at home."""

    kind: str
    axis: np.ndarray
    point: np.ndarray


def tangents(n: np.ndarray) -> np.ndarray:
    """Two unit vectors across a unit vector, rows (2, 3); the first as level as may be."""
    u = np.cross(n, [0.0, 0.0, 1.0]) if np.hypot(n[0], n[1]) > 1e-9 else np.array([0.0, 1.0, 0.0])
    u = np.cross(u, n) / np.linalg.norm(u)
    return np.array([u, np.cross(n, u)])


def principal_directions(bend: np.ndarray) -> np.ndarray:
    """Directions in which a height of second derivative (2, 2) has no mixed term, rows (2, 2), the
    more curved one first."""
    values, vectors = np.linalg.eigh(bend)
    rows = vectors.T[np.argsort(-np.abs(values))]
    return rows * np.array([[1.0], [np.sign(np.linalg.det(rows))]])
