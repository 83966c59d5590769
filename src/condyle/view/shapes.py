"""Unit shapes for the page, and the turns that lay them where they belong."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

Mesh = tuple[np.ndarray, np.ndarray]


def unit_rod(sides: int = 16) -> Mesh:
    """A closed cylinder of radius 1 along Z from 0 to 1: vertices (V, 3), faces (F, 3)."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    vertices = np.vstack([ring, np.add(ring, [0, 0, 1]), [[0, 0, 0], [0, 0, 1]]])
    i, j = np.arange(sides), np.roll(np.arange(sides), -1)
    low, high = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = [
        (i, j, j + sides),
        (i, j + sides, i + sides),
        (low, j, i),
        (high, i + sides, j + sides),
    ]
    return vertices, np.concatenate([np.column_stack(f) for f in faces])


def turn_onto(direction: np.ndarray) -> np.ndarray:
    """Quaternion (w, x, y, z) that turns Z onto a unit vector."""
    x, y, z = direction
    if z < -1 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    q = np.array([1 + z, -y, x, 0.0])
    return q / np.linalg.norm(q)


def quaternion(R: np.ndarray) -> np.ndarray:
    """(w, x, y, z) of a rotation matrix (3, 3)."""
    return np.roll(Rotation.from_matrix(R).as_quat(), 1)


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    return Rotation.from_quat(np.roll(q, -1)).as_matrix()
