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

SMALL = (1e-3, 1e-5, 1e-7)  # multiples that are tried
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


@dataclass(frozen=True)
class Priced:
    """x (n,), t, multipliers u (6,) and the prices alpha of stretched limits, (n,)."""

    x: np.ndarray
    t: float
    u: np.ndarray
    alpha: np.ndarray


@dataclass(frozen=True)
class Program:
    """Constraints on z = (x, t): low <= z <= high, least <= matrix z <= most.

    who:   the effort of each stretched limit, in the first rows of the matrix; then come the
           m equations, then the contacts.
    """

    matrix: np.ndarray
    least: np.ndarray
    most: np.ndarray
    low: np.ndarray
    high: np.ndarray
    who: np.ndarray
    m: int

    @classmethod
    def of(cls, s: Sample, lower: np.ndarray, upper: np.ndarray) -> Program:
        n, m = s.G.shape[1], s.m
        up, down = np.isfinite(upper).nonzero()[0], np.isfinite(lower).nonzero()[0]
        who = np.concatenate([up, down])
        q = len(who)
        matrix = np.zeros((q + 6, n + 1))
        matrix[np.arange(q), who] = 1.0
        matrix[:q, n] = -np.concatenate([upper[up], lower[down]])
        matrix[q:, :n] = s.G
        least, most = np.zeros(q + 6), np.zeros(q + 6)
        least[: len(up)], most[len(up) : q] = -np.inf, np.inf
        least[q:] = most[q:] = s.right
        least[q + m :] -= s.contact_high
        most[q + m :] -= s.contact_low
        low, high = np.append(s.low, 0.0), np.append(s.high, np.inf)
        return cls(matrix, least, most, low, high, who, m)

    def regularised(self, small: float) -> Priced | None:
        """The least of t + small |z|^2 / 2; None where DAQP finds none."""
        n, q = len(self.low) - 1, len(self.who)
        sense = np.zeros(n + 1 + len(self.least), dtype=np.int32)
        sense[n + 1 + q : n + 1 + q + self.m] = ACTIVE
        cost = np.zeros(n + 1)
        cost[n] = 1.0 / small
        high, low = np.concatenate([self.high, self.most]), np.concatenate([self.low, self.least])
        z, _, flag, info = daqp.solve(
            np.eye(n + 1), cost, self.matrix, high, low, sense, **TOLERANCES
        )
        if flag != 1:
            return None
        price = -small * np.asarray(info["lam"])[n + 1 :]
        alpha = np.bincount(self.who, weights=-price[:q], minlength=n)
        return Priced(z[:n], float(z[n]), price[q:], alpha)

    def exact(self) -> tuple[np.ndarray, float] | None:
        """x and t by HiGHS; None where nothing fits."""
        from scipy.optimize import linprog

        n, q = len(self.low) - 1, len(self.who)
        equal = slice(q, q + self.m)
        rest = np.r_[0:q, q + self.m : len(self.least)]
        A = np.vstack([self.matrix[rest], -self.matrix[rest]])
        b = np.concatenate([self.most[rest], -self.least[rest]])
        keep = np.isfinite(b)
        cost = np.zeros(n + 1)
        cost[n] = 1.0
        found = linprog(
            cost,
            A[keep],
            b[keep],
            self.matrix[equal],
            self.least[equal],
            list(zip(self.low, self.high, strict=True)),
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        return (found.x[:n], float(found.x[n])) if found.status == 0 else None


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
