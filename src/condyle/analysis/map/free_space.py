"""The greatest ball and the greatest box around home that are free: reachable, and more.

Free poses are reachable, within the contacts' bounds, off singularities by a margin, and, where
actuators have limits, such that efforts within them hold the load. What is found is certified as
far as it was sampled: at points a known distance apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import gamma, pi

import numpy as np

from ...errors import InputError
from ...kinematics.singularities import NEAR_SINGULAR
from ...mechanism.mechanism import COORDINATES
from ...model.model import Model
from ...progress import budget, spent, step
from .axes import Axis, Grid
from .block import Block, Setup
from .load_capacity import limited
from .reach import Reach

POINTS, FEW = 20_000, 500  # in the ball; where it has to be quick
CONES = (0.5, 0.15, 0.05)  # half widths around the nearest pose that is not free
RAYS, HALVINGS = 60, 24
QUICK = 3.0  # seconds of looking around home
TINY = 1e-4  # of the first pose found that is not free: an empty ball
GROWTH = 2.0  # of the ball until it meets something
STEPS, NUDGE = 12, 1e-6  # along the border
ROUNDING = 1e-9  # of the radius, by which rays go further
BOX = {1: 2001, 2: 201, 3: 41}  # points along each axis
RANGE = "the range"

Margins = Callable[[np.ndarray], np.ndarray]  # of points (N, d) -> (reasons, N)


@dataclass(frozen=True)
class Ball:
    """The greatest free ball around home.

    radius: [m], angles multiplied by the characteristic length;  stops: what ends it.
    points: at which all is well inside;  spacing: their mean distance [m].
    at_most: [m], a pose that is not free is there; the radius itself, unless a `budget` was spent.
    """

    radius: float
    stops: str
    points: int
    spacing: float
    at_most: float


@dataclass(frozen=True)
class Box:
    """The greatest free box around home.

    low, high: of each axis, SI;  spacing: of the points at which all is well, SI.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    spacing: tuple[float, ...]


@dataclass(frozen=True)
class FreeSpace:
    """The poses of a mechanism that are free.

    margin: least singularity ratio;  limits: whether efforts within limits must hold the load.
    """

    setup: Setup
    margin: float = NEAR_SINGULAR
    limits: bool = True

    def margins(self, q: np.ndarray) -> np.ndarray:
        """Margins (reasons, N): negative or NaN where not free; all but the last continuous."""
        model = self.setup.model
        block = Block(self.setup, q, frozenset({"ratio", "transmission", "points", "pose"}))
        survey = block.survey
        ratio = np.fmin(survey.inverse_ratio, survey.direct_ratio)
        rows = [survey.closing, *block.margin, ratio - self.margin, *block.bounds.T]
        margins = np.vstack([*rows, np.ones(len(q))])
        if self.limits and limited(model.mechanism):
            some = np.flatnonzero((margins >= 0).all(axis=0))
            held = self.setup.load_capacity.holds(block.pose[some], self.setup.load)
            margins[-1, some[~held]] = -1.0
        return margins

    @property
    def costly(self) -> bool:
        """Whether efforts have to be chosen at every pose."""
        return (
            self.limits
            and limited(self.setup.model.mechanism)
            and self.setup.load_capacity.too_many_facets
        )

    @cached_property
    def reasons(self) -> list[str]:
        """What ends where a margin is negative, in words, a reason each."""
        mechanism = self.setup.model.mechanism
        contacts = mechanism.contact_names
        return [
            f"the reach of contacts {' & '.join(contacts)}",
            *(f"the reach of chain {name}" for name in mechanism.chain_names),
            "a singularity",
            *(f"the bounds of contact {name}" for name in contacts),
            "the limits of efforts",
        ]


def greatest_ball(free: FreeSpace, grid: Grid, points: int = POINTS) -> Ball:
    """The greatest free ball within the range of the axes; the other coordinates are held.

    The nearest pose that is not free is looked for among many, and from there along the border.

    Raises: InputError: if home is outside the range.
    """
    d, length = len(grid.axes), free.setup.model.characteristic_length
    scale = np.array([1.0 if a.name in COORDINATES[:3] else 1.0 / length for a in grid.axes])
    radius = _room_in_range(grid, scale)
    points = min(points, 5 * FEW) if free.costly else points
    rng = np.random.default_rng(0)
    way = rng.normal(size=(points, d))
    way *= (rng.random((points, 1)) ** (1 / d)) / np.linalg.norm(way, axis=1, keepdims=True)
    way[0] = 0.0

    def margins(x: np.ndarray) -> np.ndarray:
        return free.margins(grid.states(x * scale))

    stops, largest = RANGE, radius
    radius = largest / GROWTH**6  # far poses cost most
    subset, at_most = way[:FEW], largest
    while radius < largest and free_of(margins(radius * subset)).all():
        radius = min(GROWTH * radius, largest)
    for some in (subset, way):
        while (bad := np.flatnonzero(~free_of(found := margins(radius * some)))).size:
            first = bad[np.argmin(np.linalg.norm(some[bad], axis=1))]
            row = int(np.argmax(~(found[:, first] >= 0)))
            nearest, row = _along_rays(margins, radius * some[first], row, rng)
            nearest = _on_the_border(margins, nearest, row)
            if spent():  # poses were given up: the rest may be free
                return _settled(Ball(radius, RANGE, FEW, 0.0, at_most), margins, subset)
            radius, stops = float(np.linalg.norm(nearest)), free.reasons[row]
            at_most = radius
            if radius == 0.0:
                return Ball(0.0, stops, points, 0.0, 0.0)
    if spent():
        return _settled(Ball(radius, RANGE, FEW, 0.0, at_most), margins, subset)
    return Ball(radius, stops, points, _spacing(radius, points, d), radius)


def _settled(ball: Ball, margins: Margins, subset: np.ndarray) -> Ball:
    """The ball that is certain without following poses, once a `budget` is spent."""
    radius = ball.radius
    while radius > TINY * ball.at_most and not free_of(margins(radius * subset)).all():
        radius /= GROWTH
    radius = radius if radius > TINY * ball.at_most else 0.0
    spacing = _spacing(radius, ball.points, subset.shape[1])
    return replace(ball, radius=radius, spacing=spacing)


def _spacing(radius: float, points: int, d: int) -> float:
    volume = pi ** (d / 2) / gamma(d / 2 + 1)  # of the unit ball
    return radius * (volume / points) ** (1 / d)


def ball_around_home(model: Model) -> Ball:
    """The free ball in all coordinates, no further than the characteristic length and a radian.

    Without limits of efforts; quick, for one look at a mechanism: in `QUICK` seconds, with what is
    certain by then.
    """
    length = model.characteristic_length
    ends = [length if name in COORDINATES[:3] else 1.0 for name in model.independent]
    axes = tuple(Axis(n, -end, end, 2) for n, end in zip(model.independent, ends, strict=True))
    reach = Reach.of(model)
    free = FreeSpace(Setup(model, reach, np.zeros(9)), limits=False)
    with step("looking for the room around home"), budget(QUICK):
        return greatest_ball(free, Grid(model.independent, axes, (0.0,) * len(axes)), FEW)


def free_of(margins: np.ndarray) -> np.ndarray:
    """Whether all margins, (reasons, N), are numbers and not negative, (N,)."""
    return np.asarray((margins >= 0).all(axis=0))


def _along_rays(
    margins: Margins, nearest: np.ndarray, row: int, rng: np.random.Generator
) -> tuple[np.ndarray, int]:
    """A pose where the rays near one that is not free end, and what ends the shortest."""
    for cone in CONES:
        size = float(np.linalg.norm(nearest))
        if size == 0.0 or spent():
            break
        rays = nearest / size + cone * rng.normal(size=(RAYS, len(nearest)))
        rays = np.vstack([nearest / size, rays / np.linalg.norm(rays, axis=1, keepdims=True)])
        out = size * (1 + ROUNDING)
        rays = rays[~free_of(margins(out * rays))]
        low, high = np.zeros(len(rays)), np.full(len(rays), out)
        for _ in range(HALVINGS if len(rays) else 0):
            if spent():
                break
            middle = (low + high) / 2
            fine = free_of(margins(middle[:, None] * rays))
            low, high = np.where(fine, middle, low), np.where(fine, high, middle)
        if len(rays) and low.min() < size:
            best = int(np.argmin(low))
            row = int(np.argmax(~(margins(high[best] * rays[best : best + 1])[:, 0] >= 0)))
            nearest = low[best] * rays[best]
    return nearest, row


def _on_the_border(margins: Margins, nearest: np.ndarray, row: int) -> np.ndarray:
    """The pose of least size at which a smooth margin vanishes, from one that is near it.

    Each step goes to the foot of the perpendicular on the margin's tangent plane.
    """
    d, x = len(nearest), nearest
    h = NUDGE * float(np.linalg.norm(nearest))
    around = h * np.vstack([np.zeros(d), np.eye(d), -np.eye(d)])
    for _ in range(STEPS if h else 0):
        v = margins(x + around)[row]
        slope = (v[1 : d + 1] - v[d + 1 :]) / (2 * h)
        square = float(slope @ slope)
        if not (np.isfinite(square) and square > 0 and np.isfinite(v[0])):
            break
        x = (slope @ x - v[0]) * slope / square
        size = float(np.linalg.norm(x))
        out = x * (1 + NUDGE)
        if size < np.linalg.norm(nearest) and not free_of(margins(out[None]))[0]:
            nearest = x
    return nearest


def _room_in_range(grid: Grid, scale: np.ndarray) -> float:
    ends = [min(-a.low, a.high) / s for a, s in zip(grid.axes, scale, strict=True)]
    if min(ends) <= 0:
        outside = [a.name for a in grid.axes if not a.low < 0 < a.high]
        raise InputError(f"home, where {outside[0]} is 0, is not inside the range of the map")
    return float(min(ends))


def greatest_box(free: FreeSpace, grid: Grid) -> Box | None:
    """The box of largest volume around home, of one to three axes; None if home is not free.

    Raises: InputError: if home is outside the range.
    """
    _room_in_range(grid, np.ones(len(grid.axes)))
    sides, homes = [], []
    for axis in grid.axes:
        n = (BOX[len(grid.axes)] - 1) // (4 if free.costly else 1)
        below = min(max(round(-axis.low / axis.span * n), 1), n - 1)
        after = np.linspace(0, axis.high, n - below + 1)
        sides.append(np.append(np.linspace(axis.low, 0, below + 1)[:-1], after))
        homes.append(below)
    points = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1)
    good = free_of(free.margins(grid.states(points.reshape(-1, len(sides)))))
    ends = best_box(good.reshape(points.shape[:-1]), homes, sides)
    if ends is None:
        return None
    both = [s[list(ab)].tolist() for s, ab in zip(sides, ends, strict=True)]
    low, high = zip(*both, strict=True)
    return Box(low, high, tuple(float(np.diff(s).max()) for s in sides))


def best_box(
    good: np.ndarray, home: Sequence[int], sides: Sequence[np.ndarray]
) -> list[tuple[int, int]] | None:
    """First and last index along each axis of the box of good points around home that is largest.

    Exact on the grid: for every range of the axes before the last, the last one's longest run.
    """
    if not good[tuple(home)]:
        return None
    if good.ndim == 3:
        best: tuple[float, list[tuple[int, int]]] = (-1.0, [])
        for low in range(home[0], -1, -1):
            slab: np.ndarray = np.asarray(good[low : home[0] + 1].all(axis=0))
            if not slab[tuple(home[1:])]:
                break
            for high in range(home[0], len(good)):
                slab = np.asarray(slab & good[high])
                if (inner := best_box(slab, home[1:], sides[1:])) is None:
                    break
                size = sides[0][high] - sides[0][low]
                for (a, b), side in zip(inner, sides[1:], strict=True):
                    size *= side[b] - side[a]
                if size > best[0]:
                    best = size, [(low, high), *inner]
        return best[1]
    left, right = _good_from(good, home[-1])
    if good.ndim == 1:
        return [(home[0] - int(left) + 1, home[0] + int(right) - 1)]
    h, at = home
    left, right = (
        np.minimum.outer(np.minimum.accumulate(n[h::-1]), np.minimum.accumulate(n[h:]))
        for n in (left, right)
    )
    first, last = at - np.maximum(left, 1) + 1, at + np.maximum(right, 1) - 1
    height = np.subtract.outer(-sides[0][h::-1], -sides[0][h:])
    area = np.where(left > 0, height * (sides[1][last] - sides[1][first]), -1.0)
    i, j = np.unravel_index(int(np.argmax(area)), area.shape)
    return [(h - int(i), h + int(j)), (int(first[i, j]), int(last[i, j]))]


def _good_from(good: np.ndarray, at: int) -> tuple[np.ndarray, np.ndarray]:
    """How many values along the last axis are good from one on, downward and upward."""
    pad = [(0, 0)] * (good.ndim - 1) + [(0, 1)]
    down, up = (
        np.argmin(np.pad(side, pad), axis=-1) for side in (good[..., at::-1], good[..., at:])
    )
    return down, up
