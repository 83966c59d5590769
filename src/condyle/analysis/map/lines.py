"""The lines of a map over two coordinates: its borders, singular curves and bounds.

Contour lines of a grid are brought onto the curve, point by point, by Newton's steps, and followed
to where another margin forbids the pose, or the function ends. Pictures of a map have these lines,
and the margin of reach on a finer grid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...extras import require
from ...model.model import Model
from ...motion.arrays import runs_of
from ...results.contacts import bound_margins
from .axes import Axis, Grid
from .map_files import grid_and_reach
from .reach import Reach, bounded

if TYPE_CHECKING:
    import xarray as xr

FINE, SLICES = 161, 6  # points along an axis of a slice at least; slices of three coordinates
FEWEST, MOST = 41, 201  # points along an axis of the grid that lines are looked for on
ROUNDING = 1e-9  # of the other margins, on a line
ROUNDS, HALVINGS = 8, 30  # of Newton; of bisection
NUDGE = 1e-6  # of the range, for differences
CLOSE = 1e-11  # of the range: how near to the curve points are brought
AROUND = NUDGE * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])

Function = Callable[[np.ndarray], np.ndarray]  # of points (N, 2) in the unit square -> (N,)


@dataclass(frozen=True)
class Curve:
    """Points on a curve, (N, 2), in the unit square; closed: the last goes on to the first."""

    points: np.ndarray
    closed: bool


@dataclass(frozen=True)
class Line(Curve):
    """A curve of a map; points: (N, 2) [m or rad] along the two axes.

    kind: reach (of a chain: an inverse singularity too), stroke, contacts (what they can meet),
          singular (direct), bounds (of a contact);  name: of the chain or contact.
    """

    kind: str
    name: str


def lines_of(reach: Reach, grid: Grid) -> list[Line]:
    """All lines of a map over two coordinates; borders where nothing else forbids the poses."""
    low, span = (np.array([getattr(axis, end) for axis in grid.axes]) for end in ("low", "span"))
    shape = [min(max(axis.count, FEWEST), MOST) for axis in grid.axes]
    square = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
    margins = Margins(reach)

    def everything(points: np.ndarray) -> np.ndarray:
        return margins.at(grid.states(low + span * points))

    values = everything(np.stack(square, axis=-1).reshape(-1, 2))
    lines = []
    for i, (kind, name) in enumerate(margins.names):
        others = [k for k in margins.forbidding if k != i]

        def f(points: np.ndarray, i: int = i) -> np.ndarray:
            return everything(points)[i]

        def allowed(points: np.ndarray, others: list[int] = others) -> np.ndarray:
            """Where rounding puts a point of a border beyond it, what is beside it counts."""
            beside = (points + 1e-3 * AROUND[:, None]).reshape(-1, 2)
            there = everything(beside).reshape(-1, len(AROUND), len(points))[others]
            known = np.where(np.isnan(there[:, 0]), np.fmax.reduce(there, axis=1), there[:, 0])
            return np.asarray((known >= -ROUNDING).all(axis=0))

        for curve in trace(f, values[i].reshape(shape), allowed):
            lines.append(Line(low + span * curve.points, curve.closed, kind, name))
    return lines


class Margins:
    """Functions of the pose that vanish on the lines.

    names: (kind, name) of each;  forbidding: those that must not be negative, by number.
    """

    def __init__(self, reach: Reach) -> None:
        model, mechanism = reach.model, reach.model.mechanism
        self._reach = reach
        self._square = len(mechanism.chains) == len(model.independent)
        self._bounded = bounded(mechanism)
        chains = mechanism.chain_names
        names = [("contacts", " & ".join(mechanism.contact_names))]
        names += [("reach", name) for name in chains]
        self._stroked = [i for i in range(len(chains)) if np.isfinite(reach.high[i])]
        for i in self._stroked:
            names += [("stroke", chains[i])] * 2
        self.forbidding: list[int] = list(range(len(names)))
        names += [("bounds", mechanism.contact_names[i]) for i in self._bounded]
        self.names: list[tuple[str, str]] = names + [("singular", "")] * self._square

    def at(self, q: np.ndarray) -> np.ndarray:
        """(names, N); no number where a function has no value."""
        reach = self._reach
        wanted = ["joint"] * bool(self._stroked) + ["points"] * bool(self._bounded)
        survey = reach.model.poses.survey(q, wanted + ["rows"] * self._square, reach.threads)
        rows = [survey.closing, *survey.discriminant]
        for i in self._stroked:
            joint = survey.values["joint"][i]
            rows += [joint - reach.low[i], reach.high[i] - joint]
        if self._bounded:
            points = np.moveaxis(survey.values["points"], -1, 0)
            rows += list(bound_margins(reach.model.mechanism, points).T[self._bounded])
        if self._square:
            rows.append(_determinant(np.moveaxis(survey.values["rows"], -1, 0)))
        return np.array(rows)


def _determinant(rows: np.ndarray) -> np.ndarray:
    """det of the dimensionless J_W over the product of its rows' lengths, (N,)."""
    determinant = np.full(len(rows), np.nan)
    good = np.isfinite(rows).all(axis=(1, 2))
    J = rows[good]
    with np.errstate(invalid="ignore", divide="ignore"):
        determinant[good] = np.linalg.det(J) / np.linalg.norm(J, axis=1).prod(axis=1)
    return determinant


def trace(f: Function, values: np.ndarray, allowed: Function | None = None) -> list[Curve]:
    """All curves f = 0 that a grid sees.

    Where f changes its sign at a pole Newton's steps find no curve.

    Args: values: of f on a grid over the unit square, (n1, n2), no number where f has none.
          allowed: whether a point of a curve is wanted; without it all are.
    """
    require("contourpy", "figures")
    from contourpy import contour_generator

    cells = np.array(values.shape) - 1
    seen: Any = contour_generator(z=np.ma.masked_invalid(_grown(values).T)).lines(0.0)
    curves = []
    for line in seen:
        closed = bool((line[0] == line[-1]).all())
        points = line[: len(line) - closed] / cells
        exact = _corrected(f, points, 2.0 / cells.max())
        good = np.isfinite(exact[:, 0])
        if allowed is not None:
            good &= allowed(np.nan_to_num(exact))
        points[good] = exact[good]
        if closed and good.all():
            curves.append(Curve(points, True))
            continue
        if closed:  # begin where it is not good, and go round to there
            order = (np.arange(len(points) + 1) + np.argmin(good)) % len(points)
            points, good = points[order], good[order]
        for run in runs_of(good):
            part = points[run]
            if run.start > 0:
                part = np.vstack([_end(f, allowed, part[0], points[run.start - 1]), part])
            if run.stop < len(points):
                part = np.vstack([part, _end(f, allowed, part[-1], points[run.stop])])
            part = part[np.append(True, np.diff(part, axis=0).any(axis=1))]
            curves += [Curve(part, False)] * (len(part) > 1)
    return curves


def _grown(values: np.ndarray) -> np.ndarray:
    """Values of a grid, (n1, n2), and beyond where they end two more, linear along the axes."""
    n1, n2 = values.shape
    for _ in range(2):
        wide = np.pad(values, 2, constant_values=np.nan)
        beyond = []
        for i, k in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            near, far = (wide[2 + m * i :, 2 + m * k :][:n1, :n2] for m in (1, 2))
            beyond.append(2 * near - far)
        known = np.isfinite(beyond)
        with np.errstate(invalid="ignore"):
            mean = np.where(known, beyond, 0.0).sum(axis=0) / known.sum(axis=0)
        values = np.where(np.isfinite(values), values, mean)
    return values


def _corrected(f: Function, start: np.ndarray, reach: float) -> np.ndarray:
    """The points of the curve near others, (N, 2), on the edge of the square along that.

    No number where Newton's steps do not find one, no farther away than `reach`.
    """
    free, x = (start > 0) & (start < 1), start
    with np.errstate(all="ignore"):
        for _ in range(ROUNDS):
            v = f((x + AROUND[:, None]).reshape(-1, 2)).reshape(len(AROUND), -1)
            slope = free * np.column_stack([v[1] - v[2], v[3] - v[4]]) / (2 * NUDGE)
            step = (v[0] / (slope**2).sum(axis=1))[:, None] * slope
            x, size = x - step, np.linalg.norm(step, axis=1)
            if not (size >= CLOSE).any():
                break
        found = (size < CLOSE) & (np.linalg.norm(x - start, axis=1) <= reach)
    return np.where(found[:, None], np.clip(x, 0.0, 1.0), np.nan)


def _end(
    f: Function, allowed: Function | None, inside: np.ndarray, outside: np.ndarray
) -> np.ndarray:
    """How far a curve goes from a point of it towards another, (2,), and is allowed."""
    way, last, low, high = outside - inside, inside, 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        found = _corrected(f, (inside + middle * way)[None], float(np.linalg.norm(way)))
        if np.isfinite(found).all() and (allowed is None or allowed(found)[0]):
            low, last = middle, found[0]
        else:
            high = middle
    return last


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


def slices_of(dataset: xr.Dataset, model: Model) -> Iterator[Slice]:
    """The slice of a map over two coordinates, or some along the last of three.

    Args: model: of the map's mechanism.
    """
    grid, reach = grid_and_reach(dataset, model)
    if len(grid.axes) == 2:
        yield _slice(reach, grid, None, None)
    elif len(grid.axes) == 3:
        *two, last = grid.axes
        count = min(SLICES, last.count)
        for index in np.unique(np.linspace(0, last.count - 1, count + 2).round()[1:-1]).astype(int):
            at = float(dataset[last.name][index])
            held = list(grid.held)
            held[grid.names.index(last.name)] = at
            yield _slice(reach, Grid(grid.names, tuple(two), tuple(held)), int(index), at)


def _slice(reach: Reach, grid: Grid, index: int | None, at: float | None) -> Slice:
    axes = tuple(Axis(a.name, a.low, a.high, max(a.count, FINE)) for a in grid.axes)
    fine = Grid(grid.names, axes, grid.held)
    margin = reach.margin(fine.block(0, fine.size)).reshape(fine.shape)
    first, second = (axis.values for axis in axes)
    return Slice(index, at, (first, second), margin, lines_of(reach, grid))
