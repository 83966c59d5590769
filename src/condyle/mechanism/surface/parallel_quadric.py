"""The parallel of a second-order surface: its closest point by one unknown.

In the principal axes of g = sum(h y^2 / 2 + b y) + e the closest point of y is

    w = (y - mu b) / (1 + mu h),   g(w) = 0:

one equation in mu, monotonic as long as all 1 + mu h are positive, as they are at the nearest
closest point. Where they come near zero, for a ball that nearly fills a steep socket, the general
way is the safer one. All else is as for any `Parallel`, at a fraction of its cost.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from .parallel import AGAIN, CONVERGED, Parallel

GUESSES = 2  # from the normal at a guessed closest point to a better one,
STEPS = 5  # and steps of Newton then
EASY = 0.5  # least 1 + mu h at home for this way
COUNT = 20  # constants


@dataclass(frozen=True)
class ParallelQuadric(Parallel):
    """Points at a signed distance [m] from a wall with `quadric`."""

    @property
    def form(self) -> str:
        return "parallel-quadric"

    def constants(self) -> tuple[float, ...]:
        """distance; origin (3), axes (9, by columns), h (3), b (3) and e of g."""
        A, origin, b, e = self.wall.quadric()
        h, axes = np.linalg.eigh(2 * A)
        numbers = (*origin, *axes.T.ravel(), *h, *(axes.T @ b), e)
        return (self.distance, *map(float, numbers))

    def bending(self, point: ca.SX, velocity: ca.SX, constants: Any = None) -> ca.SX:
        """v . dn/dt, in principal axes."""
        c = self._numbers(constants)
        *_, size, _, shrink, a, _ = self._at(point, c)
        v, n, h = _axes(c).T @ velocity, a / size, c[13:16]
        still, along = shrink * v, shrink * n
        turn = h * (still - along * (ca.dot(n, still) / ca.dot(n, along))) / size
        return ca.dot(v, turn) - ca.dot(v, n) * ca.dot(n, turn)

    def started_at(self, point: ca.SX, constants: Any = None) -> ParallelQuadric:
        return replace(self, start=self._at(point, constants)[-1])

    def _at(self, point: Any, constants: Any) -> Any:
        p, c = ca.vertcat(point[0], point[1], point[2]), self._numbers(constants)
        if self.start is None:
            return _touching()(p, c)
        y, mu = _axes(c).T @ (p - c[1:4]), self.start
        for _ in range(AGAIN):
            mu = _stepped(y, mu, c)
        phi, _, *more = _at_closest_point(y, mu, c)
        return [phi, *more]


def cheapest(general: Parallel) -> Parallel:
    """The parallel by one unknown where that is safe, else as it is."""
    h = np.linalg.eigvalsh(2 * general.wall.quadric()[0])
    if not (1 + general.multiplier * h > EASY).all():
        return general
    return ParallelQuadric(
        general.wall, general.distance, general.centre, general.closest_point, general.multiplier
    )


def _axes(c: ca.SX) -> ca.SX:
    return ca.reshape(c[4:13], 3, 3)


@lru_cache(maxsize=1)
def _touching() -> ca.Function:
    """(p, constants) -> phi, n, |grad g|, H, and in principal axes 1 / (1 + mu h), grad g; mu."""
    p, c = ca.SX.sym("p", 3), ca.SX.sym("c", COUNT)
    h, b = c[13:16], c[16:19]
    y = w = _axes(c).T @ (p - c[1:4])
    for _ in range(GUESSES):
        a = h * w + b
        w = y - a * (c[0] / ca.norm_2(a))
    mu = c[0] / ca.norm_2(h * w + b)
    for _ in range(STEPS):
        mu = _stepped(y, mu, c)
    phi, converged, *more = _at_closest_point(y, mu, c)
    return ca.Function("touching", [p, c], [phi / converged, *more])


def _stepped(y: ca.SX, mu: ca.SX, c: ca.SX) -> ca.SX:
    g, a, shrink, _ = _foot(y, mu, c[13:16], c[16:19], c[19])
    return mu + g / ca.dot(a, a * shrink)


def _at_closest_point(y: ca.SX, mu: ca.SX, c: ca.SX) -> list[ca.SX]:
    """phi, whether mu has converged, and the rest of what `_touching` returns."""
    axes, h = _axes(c), c[13:16]
    g, a, shrink, w = _foot(y, mu, h, c[16:19], c[19])
    size = ca.norm_2(a)
    stretch = 1 + mu * h
    least = ca.fmin(ca.fmin(stretch[0], stretch[1]), stretch[2])
    converged = (ca.fabs(g) <= CONVERGED) * (least > 0)
    phi = (ca.dot(a, y - w) + g) / size - c[0]
    return [phi, converged, axes @ (a / size), size, axes @ ca.diag(h) @ axes.T, shrink, a, mu]


def _foot(y: ca.SX, mu: ca.SX, h: ca.SX, b: ca.SX, e: ca.SX) -> tuple[ca.SX, ...]:
    """g, grad g and 1 / (1 + mu h) at w(mu), and w."""
    shrink = 1 / (1 + mu * h)
    w = (y - mu * b) * shrink
    half = h * w / 2 + b
    return ca.dot(w, half) + e, h * w + b, shrink, w
