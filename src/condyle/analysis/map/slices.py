"""What pictures of a map need besides its values: borders on a finer grid, and traced lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .axes import Axis, Grid
from .lines import Line, lines_of
from .reach import Reach

FINE = 161  # points along an axis at least
MOST = 6  # slices of a map over three coordinates


@dataclass(frozen=True)
class Slice:
    """Two axes of a map, the third one held.

    index:  of the third axis, None where there is none;  at: its value, SI.
    values: of the two axes, SI, at which `margin`, (n1, n2), is known: negative, or no number, out
            of reach.
    """

    index: int | None
    at: float | None
    values: tuple[np.ndarray, np.ndarray]
    margin: np.ndarray
    lines: list[Line]


def slices_of(reach: Reach, grid: Grid) -> Iterator[Slice]:
    """The slice of a map over two coordinates, or some along the last of three."""
    if len(grid.axes) == 2:
        yield _slice(reach, grid, None, None)
    elif len(grid.axes) == 3:
        *two, last = grid.axes
        count = min(MOST, last.count)
        for index in np.unique(np.linspace(0, last.count - 1, count + 2).round()[1:-1]).astype(int):
            at = float(last.values[index])
            held = list(grid.held)
            held[grid.names.index(last.name)] = at
            yield _slice(reach, Grid(grid.names, tuple(two), tuple(held)), int(index), at)


def _slice(reach: Reach, grid: Grid, index: int | None, at: float | None) -> Slice:
    axes = tuple(Axis(a.name, a.low, a.high, max(a.count, FINE)) for a in grid.axes)
    fine = Grid(grid.names, axes, grid.held)
    margin = reach.margin(fine.block(0, fine.size)).reshape(fine.shape)
    first, second = (axis.values for axis in axes)
    return Slice(index, at, (first, second), margin, lines_of(reach, grid))
