"""Curves where a function of two coordinates vanishes, traced by continuation.

Edges of a grid where the function changes its sign give places to start from, found to rounding by
bisection. From each the curve is followed: a step along the tangent, then Newton's steps back
along the gradient, shorter where the curve turns, until it closes, leaves the range, or the
function ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

BISECTIONS = 54
NUDGE = 1e-6  # of the range, for differences
CLOSE = 1e-11  # of the range: how near to the curve points are brought
TURN = np.cos(np.radians(12.0))  # of the tangent in one step, at the most
SHORTEST = 1e-5  # of the range
STEPS = 20_000
ROUNDS = 8  # of Newton

Function = Callable[[np.ndarray], np.ndarray]  # of points (N, 2) in the unit square -> (N,)


@dataclass(frozen=True)
class Curve:
    """Points on a curve, (N, 2), in the unit square; closed: the last goes on to the first."""

    points: np.ndarray
    closed: bool


def trace(f: Function, values: np.ndarray) -> list[Curve]:
    """All curves f = 0 that a grid sees.

    Where it changes its sign at a pole Newton's steps find no curve.

    Args: values: of f on a grid over the unit square, (n1, n2), no number where f has none.
    """
    starts = crossings(f, values)
    longest = 1.0 / (max(values.shape) - 1)
    found: list[Curve] = []
    while len(starts):
        curve = _follow(f, starts[0], longest)
        starts = starts[1:]
        if curve is None:
            continue
        found.append(curve)
        if len(starts):
            starts = starts[_distance(starts, curve) > 0.3 * longest]
    return found


def crossings(f: Function, values: np.ndarray) -> np.ndarray:
    """Points on edges of the grid where f changes its sign, (N, 2), to rounding."""
    n1, n2 = values.shape
    u = np.stack(np.meshgrid(np.linspace(0, 1, n1), np.linspace(0, 1, n2), indexing="ij"), axis=-1)
    ends = []
    for first, second in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        a, b = values[first], values[second]
        with np.errstate(invalid="ignore"):
            change = (np.sign(a) * np.sign(b) < 0) | ((a == 0) & (b != 0) & np.isfinite(b))
        ends.append((u[first][change], u[second][change], np.sign(b[change])))
    low, high, sign = (np.concatenate(part) for part in zip(*ends, strict=True))
    if not len(low):
        return low
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        after = f(middle) * sign >= 0
        low, high = np.where(after[:, None], low, middle), np.where(after[:, None], middle, high)
    return high


def _slope(f: Function, x: np.ndarray) -> tuple[float, np.ndarray]:
    """f and its gradient, (2,), at one point."""
    around = x + NUDGE * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    v = f(around)
    with np.errstate(invalid="ignore"):
        return float(v[0]), np.array([v[1] - v[2], v[3] - v[4]]) / (2 * NUDGE)


def corrected(f: Function, x: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The point of the curve near x and the tangent there; None where Newton does not find it."""
    last = np.inf
    for _ in range(ROUNDS):
        value, slope = _slope(f, x)
        square = float(slope @ slope)
        if not (np.isfinite(value) and np.isfinite(square) and square > 0):
            return None
        step = value * slope / square
        size = float(np.linalg.norm(step))
        x = x - step
        if size < CLOSE:
            return x, np.array([-slope[1], slope[0]]) / np.sqrt(square)
        if size > last:
            return None
        last = size
    return None


def _follow(f: Function, start: np.ndarray, longest: float) -> Curve | None:
    """The whole curve through a point, both ways from it."""
    if (first := corrected(f, start)) is None:
        return None
    x, tangent = first
    there, closed = _one_way(f, x, tangent, longest)
    if closed:
        return Curve(np.array([x, *there]), True)
    back, _ = _one_way(f, x, -tangent, longest)
    points = np.array([*back[::-1], x, *there])
    return Curve(points, False) if len(points) > 1 else None


def _one_way(
    f: Function, x: np.ndarray, tangent: np.ndarray, longest: float
) -> tuple[list[np.ndarray], bool]:
    """Points after x, and whether they come back to it."""
    start, first, step = x, tangent, longest
    points: list[np.ndarray] = []
    for _ in range(STEPS):
        found = corrected(f, x + step * tangent)
        good = found is not None
        if found is not None:
            onward = found[1] if found[1] @ tangent > 0 else -found[1]
            good = bool(onward @ tangent > TURN and np.linalg.norm(found[0] - x) < 2 * step)
        if not good or found is None:
            step /= 2
            if step < SHORTEST:
                return points, False
            continue
        if (found[0] < 0).any() or (found[0] > 1).any():
            points.append(_at_the_edge(f, x, found[0]))
            return points, False
        rest = start - found[0]
        if len(points) > 2 and np.linalg.norm(rest) < 1.01 * step and onward @ first > TURN:
            return points + [found[0]] * bool(rest @ onward > 0), True
        x, tangent = found[0], onward
        points.append(x)
        step = min(1.5 * step, longest)
    return points, False


def _at_the_edge(f: Function, inside: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Where the step from inside to outside leaves the unit square, on the curve along the edge."""
    with np.errstate(divide="ignore", invalid="ignore"):
        way = outside - inside
        parts = np.where(way > 0, (1 - inside) / way, np.where(way < 0, -inside / way, np.inf))
    k = int(np.argmin(parts))
    x = inside + parts[k] * way
    x[k] = round(x[k])
    other = 1 - k
    for _ in range(ROUNDS):
        value, slope = _slope(f, x)
        if not (np.isfinite(value) and slope[other]):
            break
        x[other] -= value / slope[other]
    return np.clip(x, 0.0, 1.0)


def _distance(points: np.ndarray, curve: Curve) -> np.ndarray:
    """From each point to the curve's nearest segment, (N,)."""
    a, b = curve.points[:-1], curve.points[1:]
    if curve.closed:
        a, b = curve.points, np.roll(curve.points, -1, axis=0)
    best = np.full(len(points), np.inf)
    for p, r in zip(a, b - a, strict=True):
        t = np.clip((points - p) @ r / max(r @ r, 1e-300), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - p - t[:, None] * r, axis=1))
    return best
