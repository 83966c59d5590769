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

import daqp
import numpy as np

from .reduced import Reduced

SMALL = (1e-2, 1e-4, 1e-6)  # multiples that are tried
GAP = 1e-10  # of t, between what was found and the bound of duality
ACTIVE = 5  # DAQP's code of an equation
TOLERANCES = {"primal_tol": 1e-12, "dual_tol": 1e-12, "iter_limit": 2000}


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


@dataclass(frozen=True)
class Sample:
    """One sample of a reduced problem in a unit in which x is of the order of one.

    unit: what x and lambda were divided by.
    """

    G: np.ndarray
    right: np.ndarray
    low: np.ndarray
    high: np.ndarray
    contact_low: np.ndarray
    contact_high: np.ndarray
    unit: float

    @classmethod
    def of(cls, r: Reduced, i: int) -> Sample:
        G, right = r.G[:, :, i], r.right[:, i]
        bounds = (r.low[:, i], r.high[:, i], r.contact_low[:, i], r.contact_high[:, i])
        rows = np.abs(G[: r.m]).sum(axis=1)
        unit = float(np.max(np.abs(right[: r.m]) / np.where(rows > 0, rows, np.inf), initial=0.0))
        if not unit:
            sizes = np.abs(np.concatenate([*bounds, right]))
            unit = float(np.max(sizes, where=np.isfinite(sizes), initial=0.0)) or 1.0
        return cls(G, right / unit, *(b / unit for b in bounds), unit)

    @property
    def m(self) -> int:
        return 6 - len(self.contact_low)


def least_stretch(s: Sample, lower: np.ndarray, upper: np.ndarray) -> Stretch:
    """Solve for one sample; limits `lower` <= 0 <= `upper` or not, infinite where there is none.

    lower, upper, t are in the unit of x before `Sample` divided it, so t is t of the caller.
    """
    lower, upper = lower / s.unit, upper / s.unit
    best: Stretch | None = None
    for small in SMALL:
        first, second = (_regularised(s, lower, upper, size) for size in (small, 0.5 * small))
        if first is None or second is None:
            continue
        x, t = second[0], float(second[1])
        # Multipliers are linear in the multiple: its limit at 0, and its rate.
        u, alpha = (2 * b - a for a, b in zip(first[2:], second[2:], strict=True))
        rate = (first[2] - second[2]) / (0.5 * small)
        gap = abs(t - _bound(s, lower, upper, u, alpha)) / max(t, 1e-12)
        found = Stretch(t, x * s.unit, u, gap, _spread(s, lower * t, upper * t, x, u, rate))
        if best is None or found.error < best.error:
            best = found
        if best.error <= GAP:
            return best
    exact = _linear_program(s, lower, upper)
    if exact is None:
        return Stretch(np.inf, np.full(len(lower), np.nan), np.full(6, np.nan), np.inf, np.inf)
    if best is not None and abs(best.t - exact[1]) <= 1e-9 * exact[1]:
        return replace(best, gap=abs(best.t - exact[1]) / max(exact[1], 1e-12))
    return Stretch(exact[1], exact[0] * s.unit, np.full(6, np.nan), 0.0, np.inf)


def _rows(
    s: Sample, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Constraints on (x, t): matrix, least and greatest values; which efforts stand in which row."""
    n, m = s.G.shape[1], s.m
    up, down = (np.flatnonzero(np.isfinite(b)) for b in (upper, lower))
    eye = np.eye(n)
    stretched = np.vstack([
        np.column_stack([eye[up], -upper[up]]), np.column_stack([eye[down], -lower[down]])
    ])  # fmt: skip
    equations = np.column_stack([s.G, np.zeros(6)])
    c = s.right[m:]
    least = np.concatenate([np.full(len(up), -np.inf), np.zeros(len(down))])
    most = np.concatenate([np.zeros(len(up)), np.full(len(down), np.inf)])
    least = np.concatenate([least, s.right[:m], c - s.contact_high])
    most = np.concatenate([most, s.right[:m], c - s.contact_low])
    return np.vstack([stretched, equations]), least, most, np.concatenate([up, down])


def _regularised(
    s: Sample, lower: np.ndarray, upper: np.ndarray, small: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
    """x, t, u and the prices alpha of stretched limits, (n,), of the regularised program."""
    n, m = s.G.shape[1], s.m
    matrix, least, most, who = _rows(s, lower, upper)
    sense = np.zeros(n + 1 + len(least), dtype=np.int32)
    sense[n + 1 + len(who) : n + 1 + len(who) + m] = ACTIVE
    cost = np.zeros(n + 1)
    cost[n] = 1.0 / small
    z, _, flag, info = daqp.solve(
        np.eye(n + 1),
        cost,
        np.ascontiguousarray(matrix),
        np.concatenate([s.high, [np.inf], most]),
        np.concatenate([s.low, [0.0], least]),
        sense,
        **TOLERANCES,
    )
    if flag != 1:
        return None
    price = -np.asarray(info["lam"])[n + 1 :] * small
    alpha = np.zeros(n)
    np.add.at(alpha, who, -price[: len(who)])
    return z[:n], np.array(z[n]), price[len(who) :], alpha


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


def _linear_program(
    s: Sample, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, float] | None:
    """x and t by HiGHS; None where nothing fits."""
    from scipy.optimize import linprog

    n, m = s.G.shape[1], s.m
    matrix, least, most, who = _rows(s, lower, upper)
    equations = slice(len(who), len(who) + m)
    rest = np.r_[0 : len(who), len(who) + m : len(least)]
    A = np.vstack([matrix[rest], -matrix[rest]])
    b = np.concatenate([most[rest], -least[rest]])
    keep = np.isfinite(b)
    cost = np.zeros(n + 1)
    cost[n] = 1.0
    found = linprog(
        cost,
        A[keep] if keep.any() else None,
        b[keep] if keep.any() else None,
        matrix[equations] if m else None,
        least[equations] if m else None,
        [*zip(s.low, s.high, strict=True), (0.0, np.inf)],
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return (found.x[:n], float(found.x[n])) if found.status == 0 else None
