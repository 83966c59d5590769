"""The lines of a map over two coordinates: its borders, singular curves and bounds, each traced."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ...results.contacts import bound_margins
from .axes import Grid
from .curves import Curve, Function, corrected, trace
from .reach import Reach

MOST = 201  # points along an axis of the grid that curves are looked for on
ROUNDING = 1e-9  # of the other margins, on a line
HALVINGS = 30


@dataclass(frozen=True)
class Line:
    """A traced curve.

    kind:   reach (of a chain: an inverse singularity too), stroke, contacts (what they can meet),
            singular (direct), bounds (of a contact).
    name:   of the chain or contact.
    points: (N, 2) [m or rad] along the two axes;  closed: the last goes on to the first.
    """

    kind: str
    name: str
    points: np.ndarray
    closed: bool


def lines_of(reach: Reach, grid: Grid) -> list[Line]:
    """All lines of a map over two coordinates; borders where nothing else forbids the poses."""
    low = np.array([axis.low for axis in grid.axes])
    span = np.array([axis.span for axis in grid.axes])
    shape = [min(max(axis.count, 41), MOST) for axis in grid.axes]
    square = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
    u = np.stack(square, axis=-1).reshape(-1, 2)

    def everything(points: np.ndarray) -> np.ndarray:
        return margins.at(grid.states(low + span * points))

    margins = Margins(reach)
    values = everything(u)
    found = []
    for i, (kind, name) in enumerate(margins.names):

        def f(points: np.ndarray, i: int = i) -> np.ndarray:
            return everything(points)[i]

        own = values[i].reshape(shape)
        if not np.isfinite(own).any():
            continue
        for curve in trace(f, own):
            for part in _allowed(curve, f, i, everything, margins.forbidding):
                found.append(Line(kind, name, low + span * part.points, part.closed))
    return found


class Margins:
    """Functions of the pose that vanish on the lines.

    names: (kind, name) of each;  forbidding: those that must not be negative, by number.
    """

    def __init__(self, reach: Reach) -> None:
        model, mechanism = reach.model, reach.model.mechanism
        self._reach = reach
        self._square = len(mechanism.chains) == len(model.independent)
        self._bounded = [
            i for i, c in enumerate(mechanism.contacts) if c.bounds.x or c.bounds.y or c.bounds.z
        ]
        chains = mechanism.chain_names
        names = [("contacts", " & ".join(mechanism.contact_names))]
        names += [("reach", name) for name in chains]
        self._stroked = [i for i in range(len(chains)) if np.isfinite(reach.high[i])]
        for i in self._stroked:
            names += [("stroke", chains[i])] * 2
        self.forbidding = list(range(len(names)))
        names += [("bounds", mechanism.contact_names[i]) for i in self._bounded]
        if self._square:
            names.append(("singular", ""))
        self.names = names

    def at(self, q: np.ndarray) -> np.ndarray:
        """(names, N); no number where a function has no value."""
        reach = self._reach
        wanted = ["joint"] * bool(self._stroked) + ["points"] * bool(self._bounded)
        wanted += ["rows"] * self._square
        found = reach.model.survey(q, wanted, reach.threads)
        rows = [found.closing, *found.discriminant]
        for i in self._stroked:
            joint = found.values["joint"][i]
            rows += [joint - reach.low[i], reach.high[i] - joint]
        if self._bounded:
            points = np.moveaxis(found.values["points"], -1, 0)
            rows += list(bound_margins(reach.model.mechanism, points).T[self._bounded])
        if self._square:
            rows.append(_determinant(np.moveaxis(found.values["rows"], -1, 0)))
        return np.array(rows)


def _determinant(rows: np.ndarray) -> np.ndarray:
    """det of the dimensionless J_W over the product of its rows' lengths, (N,)."""
    found = np.full(len(rows), np.nan)
    good = np.isfinite(rows).all(axis=(1, 2))
    J = rows[good]
    with np.errstate(invalid="ignore", divide="ignore"):
        found[good] = np.linalg.det(J) / np.linalg.norm(J, axis=1).prod(axis=1)
    return found


def _allowed(
    curve: Curve,
    f: Function,
    own: int,
    everything: Callable[[np.ndarray], np.ndarray],
    forbidding: list[int],
) -> Iterator[Curve]:
    """The parts of a curve where no other margin is negative, out to where one is."""
    others = [i for i in forbidding if i != own]

    def fine(points: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            return np.asarray((everything(points)[others] >= -ROUNDING).all(axis=0))

    good = fine(curve.points)
    if good.all():
        yield curve
        return
    if not good.any():
        return
    points = curve.points
    if curve.closed:  # begin where it is forbidden
        turn = int(np.argmin(good))
        points, good = np.roll(points, -turn, axis=0), np.roll(good, -turn)
        points, good = np.vstack([points, points[:1]]), np.append(good, False)
    changes = np.flatnonzero(np.diff(good.astype(int)))
    ends = {int(i): _corner(f, fine, points[i], points[i + 1], bool(good[i])) for i in changes}
    begin = 0
    for i in [*map(int, changes), len(points) - 1]:
        if good[i]:
            run = list(points[begin : i + 1])
            before, after = ends.get(begin - 1), ends.get(i)
            run = [before] * (before is not None) + run + [after] * (after is not None)
            if len(run) > 1:
                yield Curve(np.array(run), False)
        begin = i + 1


def _corner(
    f: Function, fine: Callable[[np.ndarray], np.ndarray], a: np.ndarray, b: np.ndarray, good: bool
) -> np.ndarray | None:
    """Where, from a to b along the curve, another margin changes its sign."""
    if not good:
        a, b = b, a
    last = None
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        found = corrected(f, a + middle * (b - a))
        if found is not None and fine(found[0][None])[0]:
            low, last = middle, found[0]
        else:
            high = middle
    return last
