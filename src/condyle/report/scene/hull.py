"""The platform as a body: the convex hull of the points that others meet it at."""

from __future__ import annotations

import numpy as np

from ...mechanism import Mechanism
from ...mechanism.home import characteristic_length

SLAB = 0.04  # half thickness of a flat platform over the characteristic length


def platform_hull(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    """Hull of the joints, contact points and landmarks in {M}.

    Points in one plane get a thickness; points on one line a small body round it.
    Returns: vertices (V, 3) [m]; triangles (F, 3), counter-clockwise seen from outside.
    """
    from scipy.spatial import ConvexHull

    points = [chain.platform for chain in mechanism.chains]
    points += [contact.point for contact in mechanism.contacts]
    points += list(mechanism.platform.points.values())
    cloud = _with_thickness(np.array(points), SLAB * characteristic_length(mechanism))
    hull = ConvexHull(cloud)
    number = np.full(len(cloud), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    vertices, faces = cloud[hull.vertices], number[hull.simplices]
    return vertices, _outward(vertices, faces)


def _with_thickness(points: np.ndarray, half: float) -> np.ndarray:
    """Points spread along the directions in which they do not extend."""
    spread = points - points.mean(axis=0)
    _, sigma, directions = np.linalg.svd(spread, full_matrices=True)
    sizes = np.append(sigma, np.zeros(3 - len(sigma)))
    for direction, size in zip(directions, sizes, strict=True):
        if size < half:
            points = np.vstack([points - half * direction, points + half * direction])
    return points


def _outward(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = ((a - vertices.mean(axis=0)) * np.cross(b - a, c - a)).sum(axis=1) < 0
    return np.where(inward[:, None], faces[:, ::-1], faces)
