"""The greatest ball and the greatest box around home that are free: reachable, and more.

Free poses are reachable, within the contacts' bounds, off singularities by a margin, and, where
actuators have limits, such that efforts within them hold the load. What is found is certified as
far as it was looked at: at so many points, so far apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import gamma, pi

import numpy as np

from ...errors import InputError
from ...kinematics.causes import owners
from ...kinematics.singularity import NEAR_SINGULAR
from ...mechanism.mechanism import COORDINATES
from .ability import limited
from .axes import Grid
from .block import Asked, Block

POINTS = 20_000  # in the ball
CONES = (0.5, 0.25, 0.12, 0.06, 0.03, 0.01)  # half widths around the nearest pose that is not free
RAYS, HALVINGS = 200, 24
ROUNDING = 1e-9  # of the radius, by which rays go further
BOX = {1: 2001, 2: 201, 3: 41}  # points along each axis
RANGE = "the range"

Why = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Ball:
    """radius: [m], angles multiplied by the characteristic length;  stops: what ends it.

    points: at which all is well inside;  spacing: their mean distance [m].
    """

    radius: float
    stops: str
    points: int
    spacing: float


@dataclass(frozen=True)
class Box:
    """low, high: of each axis, SI;  spacing: of the points at which all is well, SI."""

    low: tuple[float, ...]
    high: tuple[float, ...]
    spacing: tuple[float, ...]


@dataclass(frozen=True)
class Free:
    """Which poses are free.

    margin: least singularity ratio;  limits: whether efforts within limits must hold the load.
    """

    asked: Asked
    margin: float = NEAR_SINGULAR
    limits: bool = True

    def why_not(self, q: np.ndarray) -> np.ndarray:
        """Index into `reasons` for each of q, (N, m); 0 where it is free."""
        model = self.asked.model
        block = Block(self.asked, q, frozenset({"ratio", "transmission", "points", "pose"}))
        found = block.cause.astype(int)
        count = len(owners(model.mechanism))
        with np.errstate(invalid="ignore"):
            ratio = np.fmin(block.survey.inverse_ratio, block.survey.direct_ratio)
            found[(found == 0) & ~(ratio >= self.margin)] = count
            outside = block.bounds < 0
        beyond = (found == 0) & outside.any(axis=1)
        if beyond.any():
            found[beyond] = count + 1 + outside[beyond].argmax(axis=1)
        if self.limits and limited(model.mechanism) and (some := np.flatnonzero(found == 0)).size:
            held = self.asked.ability.holds(block.pose[some], self.asked.load)
            found[some[~held]] = len(self.reasons) - 1
        return found

    @property
    def reasons(self) -> list[str]:
        mechanism = self.asked.model.mechanism
        named = [f"the reach of {owner}" for owner in owners(mechanism)]
        bounds = [f"the bounds of contact {name}" for name in mechanism.contact_names]
        return [*named, "a singularity", *bounds, "the limits of efforts"]


def scale_of(grid: Grid, length: float) -> np.ndarray:
    """What turns a radius [m] into each axis' unit, (d,)."""
    return np.array([1.0 if a.name in COORDINATES[:3] else 1.0 / length for a in grid.axes])


def greatest_ball(free: Free, grid: Grid, points: int = POINTS) -> Ball:
    """Around home, within the range of the axes; the other coordinates are held.

    Raises: InputError: if home is outside the range.
    """
    scale, d = scale_of(grid, free.asked.model.characteristic_length), len(grid.axes)
    radius = _room_in_range(grid, scale)
    rng = np.random.default_rng(0)
    way = rng.normal(size=(points, d))
    way *= (rng.random((points, 1)) ** (1 / d)) / np.linalg.norm(way, axis=1, keepdims=True)
    way[0] = 0.0

    def why(x: np.ndarray) -> np.ndarray:
        return free.why_not(grid.states(x * scale))

    stops = RANGE
    while (bad := np.flatnonzero(found := why(radius * way))).size:
        distance = radius * np.linalg.norm(way[bad], axis=1)
        first = bad[np.argmin(distance)]
        nearest, stops = radius * way[first], free.reasons[found[first]]
        radius = float(distance.min())
        radius, stops = _refined(free, why, radius, nearest, stops, rng)
        if radius == 0.0:
            return Ball(0.0, stops, points, 0.0)
    spacing = radius * float(_ball_volume(d) / points) ** (1 / d)
    return Ball(radius, stops, points, spacing)


def _refined(
    free: Free, why: Why, radius: float, nearest: np.ndarray, stops: str, rng: np.random.Generator
) -> tuple[float, str]:
    """The nearest pose that is not free around one that is not: along rays near it."""
    for cone in CONES:
        size = np.linalg.norm(nearest)
        if size == 0.0:
            return 0.0, stops
        rays = nearest / size + cone * rng.normal(size=(RAYS, len(nearest)))
        rays = np.vstack([nearest / size, rays / np.linalg.norm(rays, axis=1, keepdims=True)])
        out = radius * (1 + ROUNDING)
        found = why(out * rays)
        some = np.flatnonzero(found)
        if not some.size:
            continue
        rays, found = rays[some], found[some]
        low, high = np.zeros(some.size), np.full(some.size, out)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            here = why(middle[:, None] * rays)
            bad = here > 0
            low, high = np.where(bad, low, middle), np.where(bad, middle, high)
            found = np.where(bad, here, found)
        best = int(np.argmin(low))
        if low[best] < radius:
            radius, stops = float(low[best]), free.reasons[found[best]]
            nearest = high[best] * rays[best]
    return radius, stops


def _ball_volume(d: int) -> float:
    return pi ** (d / 2) / gamma(d / 2 + 1)


def _room_in_range(grid: Grid, scale: np.ndarray) -> float:
    ends = [min(-a.low, a.high) / s for a, s in zip(grid.axes, scale, strict=True)]
    if min(ends) <= 0:
        outside = [a.name for a in grid.axes if not a.low < 0 < a.high]
        raise InputError(f"home, where {outside[0]} is 0, is not inside the range of the map")
    return float(min(ends))


def greatest_box(free: Free, grid: Grid) -> Box | None:
    """The box of largest volume around home, of one to three axes; None if home is not free.

    Raises: InputError: if home is outside the range.
    """
    _room_in_range(grid, np.ones(len(grid.axes)))
    sides, homes = [], []
    for axis in grid.axes:
        n = BOX[len(grid.axes)] - 1
        below = min(max(round(-axis.low / axis.span * n), 1), n - 1)
        sides.append(
            np.r_[
                np.linspace(axis.low, 0, below + 1)[:-1], np.linspace(0, axis.high, n - below + 1)
            ]
        )
        homes.append(below)
    points = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1)
    good = free.why_not(grid.states(points.reshape(-1, len(sides)))) == 0
    ends = best_box(good.reshape(points.shape[:-1]), homes, sides)
    if ends is None:
        return None
    low = tuple(float(s[a]) for s, (a, _) in zip(sides, ends, strict=True))
    high = tuple(float(s[b]) for s, (_, b) in zip(sides, ends, strict=True))
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
    if good.ndim == 1:
        return [_run(good, home[0])]
    runs = np.array(
        [_run(row, home[1]) if row[home[1]] else (home[1] + 1, home[1]) for row in good]
    )
    ok = runs[:, 0] <= home[1]
    up = int(np.argmin(np.append(ok[home[0] :], False)))  # rows onward from home that are good
    down = int(np.argmin(np.append(ok[home[0] :: -1], False)))
    above, below = runs[home[0] : home[0] + up], runs[home[0] - down + 1 : home[0] + 1][::-1]
    first = np.maximum.outer(np.maximum.accumulate(below[:, 0]), np.maximum.accumulate(above[:, 0]))
    last = np.minimum.outer(np.minimum.accumulate(below[:, 1]), np.minimum.accumulate(above[:, 1]))
    height = np.subtract.outer(
        -sides[0][home[0] - np.arange(down)], -sides[0][home[0] + np.arange(up)]
    )
    area = height * (sides[1][last] - sides[1][first])
    i, j = np.unravel_index(int(np.argmax(area)), area.shape)
    return [(home[0] - int(i), home[0] + int(j)), (int(first[i, j]), int(last[i, j]))]


def _run(good: np.ndarray, at: int) -> tuple[int, int]:
    """First and last index of the good values around one."""
    after = np.flatnonzero(~good[at:])
    before = np.flatnonzero(~good[at::-1])
    return (
        at - (int(before[0]) - 1 if before.size else at),
        at + (int(after[0]) - 1 if after.size else len(good) - 1 - at),
    )
