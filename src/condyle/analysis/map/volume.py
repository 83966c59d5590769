"""How much of the range of a map can be reached, with its error.

Cells whose corners disagree, or whose margins say that the border may be near, are halved along
every axis, again and again. A cell on the border counts by the part of it where the margin,
interpolated between its corners, is not negative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from .axes import Grid

FIRST = {1: 256, 2: 64, 3: 16}  # cells along each axis before any is halved
PARTS = {1: 64, 2: 8, 3: 4}  # of a border cell along each axis, where its margin is interpolated
BUDGET = 3_000_000  # poses
ENOUGH = 1e-5  # relative change from one level to the next that is small enough
DEEPEST = 12
NEAR = 1.0  # cells are halved where |margin| is less than this multiple of its change across


@dataclass(frozen=True)
class Volume:
    """Size of the reachable part of a map's range.

    value: product of the axes' SI units;  share: of the whole range.
    error: change that the last halving made;  bound: what the cells on the border hold, of which
           `value` counts a part: it cannot be off by more, as far as cells whose corners agree
           have no border inside.
    cell:  sides of the smallest cells, SI;  poses: how many were evaluated.
    """

    value: float
    error: float
    bound: float
    share: float
    cell: tuple[float, ...]
    poses: int


def reachable_volume(
    margin: Callable[[np.ndarray], np.ndarray], grid: Grid, budget: int = BUDGET
) -> Volume:
    """The volume of the set where `margin`, a function of q (N, m), is at least 0."""
    d = len(grid.axes)
    low = np.array([axis.low for axis in grid.axes])
    span = np.array([axis.span for axis in grid.axes])
    corners = np.array(list(product((0, 1), repeat=d)))
    cells = np.array(list(product(range(FIRST[d]), repeat=d)))
    inside, poses, before, n = 0.0, 0, np.nan, FIRST[d]
    for _ in range(DEEPEST):
        places, where = _unique(cells[:, None] + corners, n)
        values = margin(grid.states(low + span * places / n))
        poses += len(places)
        at = np.where(np.isfinite(values), values, np.nan)[where]
        good = at >= 0
        full, none = good.all(axis=1), ~good.any(axis=1)
        with np.errstate(invalid="ignore"):
            spread = np.where(np.isfinite(at).all(axis=1), at.max(axis=1) - at.min(axis=1), 0.0)
            near = np.abs(at).min(axis=1) < NEAR * spread
        border = ~(full | none)
        size = 1.0 / n**d
        share = size * (full.sum() + _parts(at[border], d).sum())
        total, open_cells = inside + share, border.sum() * size
        error = abs(total - before)
        before = total
        halved = cells[border | near]
        if error <= ENOUGH * total or poses + len(halved) * 3**d > budget or not border.any():
            break
        inside += size * (full & ~near).sum()
        cells = (2 * halved[:, None] + corners).reshape(-1, d)
        n *= 2
    scale = float(span.prod())
    if not np.isfinite(error):
        error = open_cells
    return Volume(
        total * scale, error * scale, open_cells * scale, total, tuple(map(float, span / n)), poses
    )


def _unique(places: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Lattice points, each once, and for each cell and corner which one it is."""
    d = places.shape[2]
    codes = places @ (n + 1) ** np.arange(d)
    found, where = np.unique(codes, return_inverse=True)
    points = np.column_stack([found // (n + 1) ** k % (n + 1) for k in range(d)])
    return points, where.reshape(places.shape[:2])


def _parts(at: np.ndarray, d: int) -> np.ndarray:
    """Part of each cell where the margin is at least 0, from its values at the corners, (N, 2^d).

    Where a corner has none, the contacts cannot be met: it counts as far outside as the others are
    from the border.
    """
    if not len(at):
        return np.zeros(0)
    size = np.nanmax(np.abs(at), axis=1, keepdims=True)
    at = np.where(np.isnan(at), -size, at)
    middle = (np.arange(PARTS[d]) + 0.5) / PARTS[d]
    weights = np.ones((1, 1))
    for _ in range(d):
        one = np.column_stack([1 - middle, middle])  # (points, corners)
        weights = np.einsum("pc,qk->pqck", weights, one).reshape(
            weights.shape[0] * len(middle), weights.shape[1] * 2
        )
    return (at @ weights.T >= 0).mean(axis=1)
