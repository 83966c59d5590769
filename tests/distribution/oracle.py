"""Independent answers on the full equations: active sets tried one by one, HiGHS, multipliers.

Unknown z = (effort, lambda), with six equations C z = q for one sample and one pattern of signs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from oracles.null_space import WITHIN, least
from scipy.optimize import linprog, nnls

from condyle.distribution import Problem


@dataclass(frozen=True)
class Program:
    """One sample under one pattern: C (6, n + k), q, bounds and the diagonal of the cost."""

    C: np.ndarray
    q: np.ndarray
    low: np.ndarray
    high: np.ndarray
    cost: np.ndarray
    n: int

    def least(self, within: float = WITHIN) -> tuple[float, np.ndarray] | None:
        """Least sum cost z^2 / 2, and where."""
        return least(self.C, self.q, self.low, self.high, self.cost, within)

    def least_stretch(self) -> float:
        """The least s >= 0 for which s times the limits of efforts leave a solution."""
        if (self.low[self.n :] > self.high[self.n :]).any():
            return np.inf
        free = np.repeat([[-np.inf, np.inf]], self.n, axis=0)
        bounds = np.column_stack([self.low, self.high])
        return self._highs(bounds[: self.n], np.vstack([free, bounds[self.n :]]))

    def least_maximum(self, scale: np.ndarray) -> float:
        """The least t with |effort_i| <= t scale_i within all bounds."""
        sides = np.column_stack([-scale, scale])
        return self._highs(sides, np.column_stack([self.low, self.high]))

    def _highs(self, sides: np.ndarray, bounds: np.ndarray) -> float:
        """The least s with s sides[i, 0] <= effort_i <= s sides[i, 1]; HiGHS."""
        unit = np.eye(self.n, len(self.low))
        rows = np.abs(self.C).max(axis=1)
        A = np.vstack([np.hstack([s * unit, -s * sides[:, [i]]]) for i, s in ((1, 1), (0, -1))])
        A = A[np.isfinite(A).all(axis=1)]
        options = dict.fromkeys(
            ("primal_feasibility_tolerance", "dual_feasibility_tolerance"), 1e-10
        )
        found = linprog(
            np.eye(len(self.low) + 1)[-1],
            *(A, np.zeros(len(A))),
            *(np.column_stack([self.C / rows[:, None], np.zeros(6)]), self.q / rows),
            np.vstack([bounds, [0, np.inf]]),
            options=options,
        )
        return float(found.x[-1]) if found.status == 0 else np.inf


def unexplained(
    C: np.ndarray, x: np.ndarray, gradient: np.ndarray, low: np.ndarray, high: np.ndarray
) -> float:
    """What the best multipliers of C x = q and of bounds that hold leave of a gradient, relative.

    Nothing is left where x is the least of a convex function, and only there.
    """
    near, unit = 1e-9 * np.abs(x).max(), np.eye(len(x))
    columns = np.array([*C, *(-C), *unit[x - low <= near], *(-unit[high - x <= near])]).T
    scaled = columns / np.linalg.norm(columns, axis=0)
    return float(nnls(scaled, gradient / np.abs(gradient).max(), maxiter=2000)[1])


def programs(
    p: Problem, i: int, scale: np.ndarray, limits: bool = True, weight: float = 0.0
) -> list[Program]:
    """Those of all patterns of signs of sample i."""
    rubs = np.abs(p.friction).max(axis=(0, 2)) > 0
    signs = product(*[(1, -1) if r else (0,) for r in rubs])
    return [program(p, i, sign, scale, limits, weight) for sign in signs]


def program(
    p: Problem, i: int, sign: object, scale: np.ndarray, limits: bool = True, weight: float = 0.0
) -> Program:
    sigma, none = np.array(sign, dtype=float), np.full(p.n, np.inf)
    low, high = (p.low, p.high) if limits else (-none, none)
    C = np.vstack([p.J[i], p.normal[i] - sigma[:, None] * p.friction[i]]).T
    q = p.Q[i] + p.J[i].T @ p.offset[i]
    least = p.preload if limits else 0.0
    push = p.push if limits else 0.0 * p.push
    below = np.where((sigma > 0) | (push > 0), least, -np.inf)
    above = np.where((sigma < 0) | (push < 0), -least, np.inf)
    cost = np.r_[1 / scale**2, np.full(p.k, weight)]
    return Program(C, q, np.r_[low, below], np.r_[high, above], cost, p.n)
