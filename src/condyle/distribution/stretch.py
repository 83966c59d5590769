"""The least t for which x fits between t times some limits: one linear program a sample.

    min t    with  G x + (0, lambda) = right,  t lower <= x <= t upper,  low <= x <= high,  t >= 0

With lower, upper = -1, 1 this is `minimax`; with the efforts' limits it is the shortfall. A linear
program plus a small enough multiple of a strictly convex function keeps its least value, and picks
of its solutions the one where that function is least (Mangasarian and Meyer 1979): so a quadratic
program, solved by DAQP, answers both at once. That the multiple was small enough is shown by
duality; where it is not shown, HiGHS solves the linear program.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .program import Program, Sample

SMALL = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-2)  # multiples that are tried
GAP = 1e-10  # of t, between what was found and the bound of duality


@dataclass(frozen=True)
class Stretch:
    """t, inf where nothing fits; x (n,) of least sum of squares there; multipliers u, (6,).

    gap: relative to t, by which t may exceed the least.
    spread: violation of the conditions of the least sum of squares, relative to the largest x.
    """

    t: float
    x: np.ndarray
    u: np.ndarray
    gap: float
    spread: float

    @property
    def error(self) -> float:
        return max(self.gap, self.spread)


def least_stretch(s: Sample, lower: np.ndarray, upper: np.ndarray) -> Stretch:
    """Solve for one sample; limits `lower` <= 0 <= `upper` or not, infinite where there is none.

    lower, upper, t are in the unit of x before `Sample` divided it, so t is t of the caller.
    """
    lower, upper = lower / s.unit, upper / s.unit
    program = Program.of(s, lower, upper)
    best: Stretch | None = None
    for small in SMALL:
        first, second = program.regularised(small), program.regularised(0.5 * small)
        if first is None or second is None:
            continue
        x, t = second.x, second.t
        # Multipliers are linear in the multiple: its limit at 0, and its rate.
        u, alpha = 2 * second.u - first.u, 2 * second.alpha - first.alpha
        rate = (first.u - second.u) / (0.5 * small)
        gap = abs(t - _bound(s, lower, upper, u, alpha)) / max(t, 1e-12)
        spread = _spread(s, times(t, lower), times(t, upper), x, u, rate)
        found = Stretch(t, x * s.unit, u, gap, spread)
        if best is None or found.error < best.error:
            best = found
        if best.error <= GAP:
            return best
    exact = program.exact()
    if exact is None:
        return Stretch(np.inf, np.full(len(lower), np.nan), np.full(6, np.nan), np.inf, np.inf)
    if best is not None and abs(best.t - exact[1]) <= 1e-9 * exact[1]:
        return replace(best, gap=abs(best.t - exact[1]) / max(exact[1], 1e-12))
    return Stretch(exact[1], exact[0] * s.unit, np.full(6, np.nan), 0.0, np.inf)


def times(t: float, limit: np.ndarray) -> np.ndarray:
    """t times limits; what is infinite stays so."""
    return np.where(np.isfinite(limit), t * np.where(np.isfinite(limit), limit, 0.0), limit)


def _bound(
    s: Sample, lower: np.ndarray, upper: np.ndarray, u: np.ndarray, alpha: np.ndarray
) -> float:
    """What t cannot be less than, from prices u of the equations, shared by both kinds of limit."""
    g = s.G.T @ u
    beta = g - alpha
    price = np.concatenate([beta, u[s.m :]])
    low, high = np.concatenate([s.low, s.contact_low]), np.concatenate([s.high, s.contact_high])
    bounds = np.where(price > 0, high, low)
    noise = 1e-10 * np.abs(np.concatenate([g, u])).max(initial=0.0)
    bounds = np.where(np.abs(price) <= noise, np.clip(0.0, low, high), bounds)
    stretched = np.where(alpha > 0, upper, lower)
    stretched = np.where(np.abs(alpha) <= noise, 0.0, stretched)
    worth = float(s.right @ u - price @ bounds)
    most = float(alpha @ stretched)
    return max(worth / most, 0.0) if most > 0 and np.isfinite(worth) else 0.0


def _spread(
    s: Sample, lower: np.ndarray, upper: np.ndarray, x: np.ndarray, u: np.ndarray, rate: np.ndarray
) -> float:
    """How far x is from the least sum of squares among the solutions of the linear program.

    Those solutions keep every effort with a price at its bound; the others must balance `rate`.
    """
    low, high = np.maximum(lower, s.low), np.minimum(upper, s.high)
    g = s.G.T @ u
    largest = np.abs(x).max(initial=0.0)
    near = 1e-9 * largest
    z = x - s.G.T @ rate
    wrong = np.maximum(
        np.where(x - low <= near, 0.0, np.maximum(z, 0.0)),
        np.where(high - x <= near, 0.0, np.maximum(-z, 0.0)),
    )
    wrong = np.where(np.abs(g) > 1e-9 * np.abs(g).max(initial=0.0), 0.0, wrong)
    return float(wrong.max(initial=0.0) / largest) if largest else 0.0
