"""A map as something to look at from all sides: the skin of the reachable set, or a sheet."""

from __future__ import annotations

import numpy as np

# A cube in six tetrahedra around its diagonal, corners as (x, y, z) in bits.
TETRAHEDRA = ((0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7))


def skin(margin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The surface around the points of a grid where the margin is not negative.

    Closed where the range ends. By marching tetrahedra, the margin linear along their edges.

    Args:    margin: (n1, n2, n3), no number where it is negative.
    Returns: vertices (V, 3) in the unit cube, and faces (F, 3).
    """
    size = float(np.nanmax(np.abs(margin), initial=1e-300))
    field = np.pad(np.where(np.isnan(margin), -size, margin), 1, constant_values=-size)
    n = np.array(field.shape)
    cubes = np.stack(np.meshgrid(*(np.arange(k - 1) for k in n), indexing="ij"), -1).reshape(-1, 3)
    offsets = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)])
    at = cubes[:, None] + offsets
    values = field[at[..., 0], at[..., 1], at[..., 2]]
    border = (values >= 0).any(axis=1) & (values < 0).any(axis=1)
    at, values = at[border].astype(float), values[border]
    triangles = [part for t in TETRAHEDRA for part in _tetrahedra(at[:, t], values[:, t])]
    corners = np.concatenate([np.zeros((0, 3, 3)), *triangles]) - 1.0
    vertices = np.clip(corners.reshape(-1, 3) / (np.array(margin.shape) - 1), 0.0, 1.0)
    vertices, names = np.unique(vertices.round(9), axis=0, return_inverse=True)
    faces = names.reshape(-1, 3)
    whole = (
        (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    )
    return vertices, faces[whole]


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

    one, two, three = (np.flatnonzero(count == k) for k in (1, 2, 3))
    found = [np.stack([cut(one, 0, j) for j in (1, 2, 3)], axis=1)]
    found.append(np.stack([cut(three, i, 3) for i in (0, 1, 2)], axis=1))
    a, b, c, d = (cut(two, i, j) for i, j in ((0, 2), (0, 3), (1, 3), (1, 2)))
    found += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    return found


def sheet(good: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An upright one over the cells of a grid (n1, n2) whose four corners are good.

    Returns: vertices (n1 n2, 3), of which the middle entry is 0.5, and faces (F, 3).
    """
    n1, n2 = good.shape
    first, second = np.meshgrid(np.linspace(0, 1, n1), np.linspace(0, 1, n2), indexing="ij")
    vertices = np.column_stack([first.ravel(), np.full(n1 * n2, 0.5), second.ravel()])
    name = np.arange(n1 * n2).reshape(n1, n2)
    a, b, c, d = name[:-1, :-1], name[1:, :-1], name[1:, 1:], name[:-1, 1:]
    whole = good[:-1, :-1] & good[1:, :-1] & good[1:, 1:] & good[:-1, 1:]
    a, b, c, d = (corner[whole] for corner in (a, b, c, d))
    return vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


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
