"""Contact surfaces as pictures: a patch with the bounds, its outline, and unit normals.

A surface is an equation phi(p) = 0: the wall that a ball touches, or the locus of its centre, which
are the same without a radius. Over a grid of two coordinates the third follows by Newton
from the home point: over (x, y) where the surface can be seen from above, else over its tangent
plane at home.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...kinematics.batch import evaluate
from ...kinematics.surface_points import surface_heights, surface_phi
from ...mechanism import Contact

GRID = 17  # points along each side of a patch
HATCH = 0.06  # length of a stroke of the hatch over the size of a picture
APART = 3  # segments of the border from stroke to stroke
LEVEL = 0.3  # least |n_z| at home for which (x, y) are the grid


@dataclass(frozen=True)
class Patch:
    """A piece of surface.

    vertices: (V, 3) [m];  faces: (F, 3);  outline: its border as segments, (E, 2, 3) [m].
    bounded:  whether the outline is where the file says the surface ends.
    hatch: strokes from the outline to the side where the ball must not be, (H, 2, 3) [m]; none for
        a contact without a `side`.
    """

    vertices: np.ndarray
    faces: np.ndarray
    outline: np.ndarray
    bounded: bool
    hatch: np.ndarray


def contact_normals(contact: Contact, points: np.ndarray) -> np.ndarray:
    """Unit normals n of the contact at ball centres (N, 3): grad phi / |grad phi|."""
    _, gradient = evaluate(surface_phi(contact.offset_surface), points)
    with np.errstate(invalid="ignore", divide="ignore"):
        return gradient / np.linalg.norm(gradient, axis=1, keepdims=True)


def contact_patch(contact: Contact, track: np.ndarray, size: float) -> Patch:
    """The wall within the bounds; without them, round the track (N, 3) of the ball centre.

    Args: size: a length of the mechanism [m], for the margin round a track.
    """
    frame = _frame(contact)
    seen = track[np.isfinite(track).all(axis=1)]
    along = (np.vstack([seen, contact.point]) - contact.point) @ frame[:2].T
    low, high = along.min(axis=0) - 0.1 * size, along.max(axis=0) + 0.1 * size
    bounds = contact.bounds
    from_above = np.array_equal(frame, np.eye(3))
    if from_above:
        for axis, interval in enumerate((bounds.x, bounds.y)):
            if interval is not None:
                low[axis], high[axis] = np.subtract(interval, contact.point[axis])
    u, v = np.meshgrid(*(np.linspace(low[i], high[i], GRID) for i in range(2)), indexing="ij")
    vertices = _solve(
        contact.surface, contact.point, frame, np.column_stack([u.ravel(), v.ravel()])
    )
    keep = np.isfinite(vertices).all(axis=1) & _inside(bounds, vertices, size)
    faces = _triangles(GRID)
    faces = faces[keep[faces].all(axis=1)]
    bounded = any(getattr(bounds, axis) is not None for axis in "xyz")
    border = vertices[_border(faces)]
    return Patch(vertices, faces, border, bounded, _hatch(contact, border, HATCH * size))


def _hatch(contact: Contact, border: np.ndarray, length: float) -> np.ndarray:
    """Strokes (H, 2, 3) from the middles of a border's segments, away from the ball."""
    if not contact.push or not len(border):
        return np.empty((0, 2, 3))
    starts = border[::APART].mean(axis=1)
    _, gradient = evaluate(surface_phi(contact.surface), starts)
    away = -contact.push * gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    return np.stack([starts, starts + length * away], axis=1)


def contact_profile(contact: Contact, track: np.ndarray) -> np.ndarray | None:
    """The locus of the centre seen from the side at the y of home, past a track: (M, 3) [m].

    Over x, or where it is upright over z. None for a surface whose equation is not known.
    """
    if not contact.surface.known:
        return None
    n = contact_normals(contact, np.array([contact.point]))[0]
    axis, up = (0, 2) if abs(n[2]) > LEVEL else (2, 0)
    seen = track[np.isfinite(track).all(axis=1), axis]
    reach = [*seen, contact.point[axis], *((contact.bounds.x, contact.bounds.z)[axis // 2] or ())]
    spare = 0.1 * (max(reach) - min(reach))
    frame = np.eye(3)[[axis, 1, up]]
    flat = np.zeros((61, 2))
    flat[:, 0] = np.linspace(min(reach) - spare, max(reach) + spare, 61) - contact.point[axis]
    return _solve(contact.offset_surface, contact.point, frame, flat)


def _frame(contact: Contact) -> np.ndarray:
    """Rows u, v, w: the grid's directions and the one that Newton moves along."""
    n = contact_normals(contact, np.array([contact.point]))[0]
    if abs(n[2]) > LEVEL:
        return np.eye(3)
    u = np.cross([0.0, 0.0, 1.0], n)
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(n, u), n])


def _solve(
    surface: Any, home: tuple[float, ...], frame: np.ndarray, flat: np.ndarray
) -> np.ndarray:
    """Points of the surface over grid coordinates (N, 2) from the home point; NaN where none."""
    height, step = surface_heights(surface, home, frame, flat)
    height[~(step < 1e-9)] = np.nan
    return np.asarray(home) + flat @ frame[:2] + height[:, None] * frame[2]


def _inside(bounds: object, points: np.ndarray, size: float) -> np.ndarray:
    """Which points are within the bounds, to a rounding error."""
    inside = np.ones(len(points), dtype=bool)
    for axis, name in enumerate("xyz"):
        if (interval := getattr(bounds, name)) is not None:
            low, high = interval
            slack = 1e-9 * size
            inside &= (points[:, axis] >= low - slack) & (points[:, axis] <= high + slack)
    return inside


def _triangles(count: int) -> np.ndarray:
    """Two triangles for each cell of a count x count grid, (F, 3)."""
    corner = np.arange(count * count).reshape(count, count)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    both = [np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))]
    return np.concatenate(both)


def _border(faces: np.ndarray) -> np.ndarray:
    """Edges that belong to one triangle only, (E, 2)."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return unique[count == 1]
