"""The grid of a map: one to three independent coordinates vary, the others are held.

As text `X=-5:5:200 mm`: from -5 to 5 mm in 200 values; held coordinates as `Y=1 mm,alpha=2 deg`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import InputError, brief, did_you_mean, texts_of
from ...files.limits import MAP_AXES, MAP_POINTS
from ...mechanism.home import characteristic_length, dependent_coordinates, independent_coordinates
from ...mechanism.mechanism import COORDINATES, Mechanism
from ...motion.written_values import Values, number, parsed, scale_of, values_of

Over = str | Sequence[str] | Mapping[str, tuple[float, float, int]]


@dataclass(frozen=True)
class Axis:
    """A coordinate from `low` to `high`, SI: `count` values at equal distances."""

    name: str
    low: float
    high: float
    count: int

    @property
    def values(self) -> np.ndarray:
        """(count,) [m or rad]."""
        return np.linspace(self.low, self.high, self.count)

    @property
    def span(self) -> float:
        return self.high - self.low


@dataclass(frozen=True)
class Grid:
    """Points of the independent coordinates: the axes vary, the last one fastest.

    names: the independent coordinates, (m,);  held: their values where no axis has them, (m,).
    """

    names: tuple[str, ...]
    axes: tuple[Axis, ...]
    held: tuple[float, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(axis.count for axis in self.axes)

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def columns(self) -> list[int]:
        """Columns of q that the axes move."""
        return [self.names.index(axis.name) for axis in self.axes]

    def states(self, points: np.ndarray) -> np.ndarray:
        """q, (N, m), of points along the axes, (N, d) [m or rad]."""
        q = np.empty((len(points), len(self.names)), order="F")
        q[:] = self.held
        q[:, self.columns] = points
        return q

    def block(self, start: int, stop: int) -> np.ndarray:
        """q of some points in their order, (stop - start, m)."""
        places = np.unravel_index(np.arange(start, stop), self.shape)
        along = [axis.values[i] for axis, i in zip(self.axes, places, strict=True)]
        return self.states(np.column_stack(along))


def grid_of(mechanism: Mechanism, over: Over | None, hold: Values = "") -> Grid:
    """The grid of a map.

    Args:   over: texts such as "X=-5:5:200 mm", or {"X": (low, high, count)} in SI; default: the
            first two coordinates.
            hold: text such as "Y=0 mm,alpha=0 deg", or {"Y": value} in SI; 0 for the others.
    Raises: InputError: for an unknown coordinate or unit, or a wrong range or count.
    """
    names = independent_coordinates(mechanism)
    if over is None:
        half = characteristic_length(mechanism) / 2
        ends = {name: half if name in COORDINATES[:3] else 0.5 for name in names[:2]}
        axes = [Axis(name, -end, end, 100) for name, end in ends.items()]
    elif isinstance(over, Mapping):
        axes = []
        for name, of in over.items():
            if not isinstance(of, Sequence) or isinstance(of, str) or len(of) != 3:
                raise InputError(
                    f"over: {brief(name)}: expected (low, high, count), got {brief(of)}"
                )
            axes.append(_axis(name, *of))
    else:
        axes = [_axis_of(text) for text in texts_of("over", over, separated=False)]
    if not 1 <= len(axes) <= MAP_AXES.most:
        raise InputError(
            f"over: expected one to three coordinates, got {len(axes)}; available: "
            f"{', '.join(names)}"
        )
    held = values_of(hold, COORDINATES, "hold")
    moved = [axis.name for axis in axes]
    for name in (*moved, *held):
        require_independent(mechanism, name)
    for name in moved:
        if moved.count(name) > 1:
            raise InputError(f"over: {name} is given twice")
        if name in held:
            raise InputError(f"hold: {name} is an axis of the map too; leave one out")
    grid = Grid(names, tuple(axes), tuple(held.get(name, 0.0) for name in names))
    MAP_POINTS.check(grid.size, "over")
    return grid


def require_independent(mechanism: Mechanism, name: str) -> None:
    """Raises InputError for a coordinate that cannot be given."""
    names = independent_coordinates(mechanism)
    if name in dependent_coordinates(mechanism):
        raise InputError(
            f'{name} is determined by the contacts of "{mechanism.name}"; its independent '
            f"coordinates are {', '.join(names)}"
        )
    if name not in names:
        raise InputError(f'"{name}" is not a coordinate.{did_you_mean(name, names)}')


def _axis_of(text: str) -> Axis:
    """`X=-5:5:200 mm` as an axis in SI."""
    form = "name=low:high:count unit", "X=-5:5:200 mm", "over"
    name, (low, high, count), unit = parsed(text, *form)
    where = f"over: {text.strip()}"
    scale = scale_of(name, unit, where)
    return _axis(name, number(low, where) * scale, number(high, where) * scale, count)


def _axis(name: str, low: object, high: object, count: object) -> Axis:
    where = f"over: {name}"
    ends = [number(value, where) for value in (low, high)]
    points = number(count, f"{where}: count")
    if points != int(points) or points < 2:
        raise InputError(f"{where}: expected a whole count of at least 2, got {count}")
    if not ends[0] < ends[1]:
        raise InputError(f"{where}: the range {ends[0]:g} to {ends[1]:g} must be increasing")
    return Axis(name, ends[0], ends[1], int(points))
