"""One sample as DAQP and HiGHS want it."""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import numpy as np

from .reduced import Reduced

ACTIVE = 5  # DAQP's code of an equation
TOLERANCES = {"primal_tol": 1e-12, "dual_tol": 1e-12, "iter_limit": 2000}


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
        low, high, contact_low, contact_high = (b / unit for b in bounds)
        return cls(G, right / unit, low, high, contact_low, contact_high, unit)

    @property
    def m(self) -> int:
        return 6 - len(self.contact_low)


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
        if found.status != 0 or found.x is None:
            return None
        return found.x[:n], float(found.x[n])
