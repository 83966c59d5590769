"""The smallest factor t on the limits for which x is feasible: one linear program a sample.

    min t    with  G x + (0, lambda) = right,  t lower <= x <= t upper,  low <= x <= high,  t >= 0

With lower, upper = -1, 1 this is `minimax`; with the efforts' limits it is the shortfall. A small
enough quadratic regularisation keeps the minimum of a linear program and selects its solution of
least norm (Mangasarian and Meyer 1979), so one quadratic program, solved by DAQP, gives both.
Duality shows whether the regularisation was small enough; otherwise HiGHS solves the linear
program.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import daqp
import numpy as np

from .active_set import EQUATION, TOLERANCES
from .certificate import unexplained
from .eliminated import Sample
from .result import CERTIFIED

SMALL = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-2)  # regularisations, in the order of trial
GAP = 1e-10  # duality gap over t


@dataclass(frozen=True)
class Stretch:
    """t, inf if infeasible; the minimum-norm x (n,) there; multipliers u, (6,).

    gap:    duality gap, relative to t.
    spread: violation of the minimum-norm conditions, relative to the largest x.
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
    """Solve for one sample; limits of any sign, infinite where there is none."""
    program = _Program.of(s, lower, upper)
    best: Stretch | None = None
    for small in SMALL:
        first, second = program.regularised(small), program.regularised(0.5 * small)
        if first is None or second is None:
            continue
        x, t = second[0][:-1], float(second[0][-1])
        # Multipliers are linear in the regularisation: their limit at 0, and their rate.
        u, alpha = (2 * b - a for a, b in zip(first[1:], second[1:], strict=True))
        rate = (first[1] - second[1]) / (0.5 * small)
        gap = abs(t - _bound(s, lower, upper, u, alpha)) / max(t, 1e-12)
        spread = _spread(s, times(t, lower), times(t, upper), x, u, rate)
        found = Stretch(t, x, u, gap, spread)
        if best is None or found.error < best.error:
            best = found
        if best.error <= GAP:
            return best
    exact = program.exact()
    if exact is None:
        return Stretch(np.inf, np.full(len(lower), np.nan), np.full(6, np.nan), np.inf, np.inf)
    x, t = exact[:-1], float(exact[-1])
    if best is not None and abs(best.t - t) <= 1e-9 * t:
        return replace(best, gap=abs(best.t - t) / max(t, 1e-12))
    return Stretch(t, x, np.full(6, np.nan), 0.0, np.inf)


def times(t: float, limit: np.ndarray) -> np.ndarray:
    """t times limits; infinite ones stay infinite."""
    return np.where(np.isfinite(limit), t * np.where(np.isfinite(limit), limit, 0.0), limit)


@dataclass(frozen=True)
class _Program:
    """Constraints on z = (x, t): low <= z <= high, least <= matrix z <= most.

    who: the effort of each stretched limit, in the first rows of the matrix; then come the
         m equations, then the contacts.
    """

    matrix: np.ndarray
    least: np.ndarray
    most: np.ndarray
    low: np.ndarray
    high: np.ndarray
    who: np.ndarray
    equations: slice

    @classmethod
    def of(cls, s: Sample, lower: np.ndarray, upper: np.ndarray) -> _Program:
        n, m = s.G.shape[1], s.m
        up, down = np.isfinite(upper).nonzero()[0], np.isfinite(lower).nonzero()[0]
        who, none = np.concatenate([up, down]), np.zeros((6, 1))
        q = len(who)
        sides = -np.concatenate([upper[up], lower[down]])[:, None]
        matrix = np.block([[np.eye(n)[who], sides], [s.G, none]])
        free = np.full(q, np.inf)
        b, c = s.right[:m], s.right[m:]
        least = np.concatenate([-free[: len(up)], 0 * down, b, c - s.contact_high])
        most = np.concatenate([0.0 * up, free[len(up) :], b, c - s.contact_low])
        low, high = np.append(s.low, 0.0), np.append(s.high, np.inf)
        return cls(matrix, least, most, low, high, who, slice(q, q + m))

    def regularised(self, small: float) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """z that minimises t + small |z|^2 / 2, multipliers u (6,) and of the limits, (n,)."""
        size, q = len(self.low), len(self.who)
        sense = np.zeros(size + len(self.least), dtype=np.int32)
        sense[size:][self.equations] = EQUATION
        cost = np.append(np.zeros(size - 1), 1.0 / small)
        high, low = np.concatenate([self.high, self.most]), np.concatenate([self.low, self.least])
        z, _, flag, info = daqp.solve(
            np.eye(size), cost, self.matrix, high, low, sense, **TOLERANCES
        )
        if flag != 1:
            return None
        u = -small * np.asarray(info["lam"])[size:]
        return np.array(z), u[q:], np.bincount(self.who, -u[:q], minlength=size - 1)

    def exact(self) -> np.ndarray | None:
        """z by HiGHS; None if infeasible."""
        from scipy.optimize import linprog

        equal = np.zeros(len(self.least), dtype=bool)
        equal[self.equations] = True
        sides = [self.matrix[~equal], -self.matrix[~equal]]
        A, b = np.vstack(sides), np.concatenate([self.most[~equal], -self.least[~equal]])
        finite = np.isfinite(b)
        result = linprog(
            np.append(np.zeros(len(self.low) - 1), 1.0),
            A[finite],
            b[finite],
            self.matrix[equal],
            self.least[equal],
            list(zip(self.low, self.high, strict=True)),
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        return None if result.status != 0 or result.x is None else np.array(result.x)


def _bound(
    s: Sample, lower: np.ndarray, upper: np.ndarray, u: np.ndarray, alpha: np.ndarray
) -> float:
    """Dual lower bound on t, from multipliers u of the equations and alpha of scaled limits."""
    g = s.G.T @ u
    multiplier = np.concatenate([g - alpha, u[s.m :]])
    low, high = np.concatenate([s.low, s.contact_low]), np.concatenate([s.high, s.contact_high])
    bounds = np.where(multiplier > 0, high, low)
    noise = 1e-10 * np.abs(np.concatenate([g, u])).max(initial=0.0)
    bounds = np.where(np.abs(multiplier) <= noise, np.clip(0.0, low, high), bounds)
    stretched = np.where(alpha > 0, upper, lower)
    stretched = np.where(np.abs(alpha) <= noise, 0.0, stretched)
    if not np.isfinite(bounds).all():
        return 0.0
    value, most = float(s.right @ u - multiplier @ bounds), float(alpha @ stretched)
    return max(value / most, 0.0) if most > 0 else 0.0


def _spread(
    s: Sample, lower: np.ndarray, upper: np.ndarray, x: np.ndarray, u: np.ndarray, rate: np.ndarray
) -> float:
    """Violation of the minimum-norm conditions among the solutions of the linear program.

    Those solutions keep efforts with a multiplier at their bounds; the others balance `rate`,
    which is a difference over the regularisation and as inexact as that is small: it is corrected
    by what the efforts between their bounds are.
    """
    g, largest = s.G.T @ u, np.abs(x).max(initial=0.0)
    low, high = np.maximum(lower, s.low), np.minimum(upper, s.high)
    near = CERTIFIED * largest
    between = (x > low + near) & (x < high - near)
    part = s.G[:, between].T
    rate = rate + np.linalg.lstsq(part, x[between] - part @ rate)[0]
    wrong = unexplained(x - s.G.T @ rate, x, low, high, largest)
    wrong = np.where(np.abs(g) > 1e-9 * np.abs(g).max(initial=0.0), 0.0, wrong)
    return float(wrong.max(initial=0.0) / largest) if largest else 0.0
