"""A map as something to look at from all sides: the skin of the reachable set, or a sheet."""

from __future__ import annotations

import numpy as np

# A cube in six tetrahedra around its diagonal, corners as (x, y, z) in bits.
TETRAHEDRA = ((0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7))
# By the number of corners inside: edges from those inside to those outside that a triangle cuts.
TRIANGLES = (
    (1, ((0, 1), (0, 2), (0, 3))),
    (3, ((0, 3), (1, 3), (2, 3))),
    (2, ((0, 2), (0, 3), (1, 3))),
    (2, ((0, 2), (1, 3), (1, 2))),
)


def isosurface(margin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The surface around the points of a grid where the margin is not negative.

    Closed where the range ends. By marching tetrahedra, the margin linear along their edges.

    Args:    margin: (n1, n2, n3), no number where it is negative.
    Returns: vertices (V, 3) in the unit cube, and faces (F, 3).
    """
    size = float(np.nanmax(np.abs(margin), initial=1e-300))
    field = np.pad(np.where(np.isnan(margin), -size, margin), 1, constant_values=-size)
    cubes = np.argwhere(np.ones(np.array(field.shape) - 1, dtype=bool))
    at = cubes[:, None] + np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)])
    values = field[tuple(np.moveaxis(at, -1, 0))]
    border = (values >= 0).any(axis=1) & (values < 0).any(axis=1)
    at, values = at[border].astype(float), values[border]
    triangles = [part for t in TETRAHEDRA for part in _tetrahedra(at[:, t], values[:, t])]
    corners = np.concatenate([np.zeros((0, 3, 3)), *triangles]) - 1.0
    vertices = np.clip(corners.reshape(-1, 3) / (np.array(margin.shape) - 1), 0.0, 1.0)
    vertices, names = np.unique(vertices.round(9), axis=0, return_inverse=True)
    faces = names.reshape(-1, 3)
    return vertices, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]


def _tetrahedra(at: np.ndarray, values: np.ndarray) -> list[np.ndarray]:
    """Triangles (F, 3, 3) in tetrahedra with corners (N, 4, 3) and values there (N, 4)."""
    inside = values >= 0
    count = inside.sum(axis=1)
    order = np.argsort(~inside, axis=1, kind="stable")  # those inside first
    at = np.take_along_axis(at, order[..., None], axis=1)
    values = np.take_along_axis(values, order, axis=1)

    def cut(rows: np.ndarray, i: int, j: int) -> np.ndarray:
        a, b = values[rows, i], values[rows, j]
        part = (a / (a - b))[:, None]
        return at[rows, i] + part * (at[rows, j] - at[rows, i])

    return [
        np.stack([cut(np.flatnonzero(count == k), i, j) for i, j in edges], axis=1)
        for k, edges in TRIANGLES
    ]


def sheet(good: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An upright one over the cells of a grid (n1, n2) whose four corners are good.

    Returns: vertices (n1 n2, 3), of which the middle entry is 0.5, and faces (F, 3).
    """
    n1, n2 = good.shape
    first, second = np.indices((n1, n2)).reshape(2, -1)
    vertices = np.column_stack([first / (n1 - 1), np.full(n1 * n2, 0.5), second / (n2 - 1)])
    name = np.arange(n1 * n2).reshape(n1, n2)
    corners = np.array([name[:-1, :-1], name[1:, :-1], name[1:, 1:], name[:-1, 1:]])
    cells = corners[:, good.ravel()[corners].all(axis=0)].T
    return vertices, np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])


def first_hit(
    origin: np.ndarray, direction: np.ndarray, vertices: np.ndarray, faces: np.ndarray
) -> np.ndarray | None:
    """Where a ray first meets a surface, (3,), or None ([Moeller and Trumbore 1997])."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    p = np.cross(direction, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / np.einsum("ij,ij->i", b - a, p)
        u = np.einsum("ij,ij->i", origin - a, p) * inverse
        q = np.cross(origin - a, b - a)
        v = q @ direction * inverse
        t = np.einsum("ij,ij->i", c - a, q) * inverse
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & np.isfinite(t)
    return origin + t[hit].min() * direction if hit.any() else None
