"""Independent answers: active sets tried one by one, and SciPy's solvers, on the full equations.

Unknown z = (effort, lambda), with six equations C z = q for one sample and one pattern of signs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from scipy.optimize import linprog, minimize

from condyle.distribution import Problem


@dataclass(frozen=True)
class Full:
    """One sample under one pattern: C (6, n + k), q, bounds and the diagonal of the cost."""

    C: np.ndarray
    q: np.ndarray
    low: np.ndarray
    high: np.ndarray
    cost: np.ndarray
    n: int


def signs(problem: Problem) -> list[tuple[int, ...]]:
    rubs = np.abs(problem.friction).max(axis=(0, 2)) > 0
    return list(product(*[(1, -1) if r else (0,) for r in rubs]))


def full(
    problem: Problem, i: int, sign: tuple[int, ...], scale: np.ndarray, limits: bool, weight: float
) -> Full:
    n, k = problem.n, problem.k
    sigma = np.array(sign, dtype=float)
    D = problem.normal[i] - sigma[:, None] * problem.friction[i]
    C = np.vstack([problem.J[i], D]).T.copy()
    q = problem.Q[i] + problem.J[i].T @ problem.offset[i]
    low = problem.low.copy() if limits else np.full(n, -np.inf)
    high = problem.high.copy() if limits else np.full(n, np.inf)
    least = problem.preload if limits else 0.0
    contact_low = np.where(sigma > 0, least, -np.inf)
    contact_high = np.where(sigma < 0, -least, np.inf)
    if limits:
        contact_low = np.where(
            problem.push > 0, np.maximum(contact_low, problem.preload), contact_low
        )
        contact_high = np.where(
            problem.push < 0, np.minimum(contact_high, -problem.preload), contact_high
        )
    cost = np.concatenate([1 / scale**2, np.full(k, weight)])
    return Full(
        C, q, np.concatenate([low, contact_low]), np.concatenate([high, contact_high]), cost, n
    )


def best_active_set(f: Full, tolerance: float = 1e-9) -> tuple[float, np.ndarray] | None:
    """Least sum cost z^2 / 2: of all active sets that leave the equations solvable, the best.

    Every candidate is the least on its active set, so the best feasible one is the least of all.
    """
    size = len(f.low)
    if (f.low > f.high).any():
        return None
    rows = np.abs(f.C).max(axis=1)
    C, q = f.C / rows[:, None], f.q / rows
    best = None
    bounds = [[(j, v) for v in {f.low[j], f.high[j]} if np.isfinite(v)] for j in range(size)]
    able = [j for j in range(size) if bounds[j]]
    for active in range(size - 6 + 1):
        for chosen in combinations(able, active):
            for values in product(*(bounds[j] for j in chosen)):
                fixed = np.zeros((active, size))
                fixed[np.arange(active), list(chosen)] = 1.0
                E = np.vstack([C, fixed])
                right = np.concatenate([q, [v for _, v in values]])
                K = np.block([[np.diag(f.cost), E.T], [E, np.zeros((len(E), len(E)))]])
                if np.linalg.cond(K) > 1e13:
                    continue
                z = np.linalg.solve(K, np.concatenate([np.zeros(size), right]))[:size]
                big = 1 + np.abs(z).max()
                if (z >= f.low - tolerance * big).all() and (z <= f.high + tolerance * big).all():
                    value = 0.5 * float(f.cost @ z**2)
                    if best is None or value < best[0]:
                        best = value, z
    return best


def least_stretch(f: Full) -> float:
    """The least s >= 0 for which s times the limits of efforts leave a solution; HiGHS."""
    n, size = f.n, len(f.low)
    if (f.low[n:] > f.high[n:]).any():
        return np.inf
    A, b = [], []
    for j in range(n):
        for sign, bound in ((1.0, f.high[j]), (-1.0, f.low[j])):
            if np.isfinite(bound):
                row = np.zeros(size + 1)
                row[j], row[-1] = sign, -sign * bound
                A.append(row)
                b.append(0.0)
    rows = np.abs(f.C).max(axis=1)
    unbound = [(None, None)] * n
    contacts = list(zip(f.low[n:], f.high[n:], strict=True))
    found = linprog(
        np.r_[np.zeros(size), 1.0],
        np.array(A) if A else None,
        np.array(b) if b else None,
        np.column_stack([f.C / rows[:, None], np.zeros(6)]),
        f.q / rows,
        [*unbound, *contacts, (0, None)],
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return float(found.x[-1]) if found.status == 0 else np.inf


def least_maximum(f: Full, scale: np.ndarray) -> float:
    """The least t with |effort_i| <= t scale_i within all bounds; HiGHS."""
    n, size = f.n, len(f.low)
    A = np.zeros((2 * n, size + 1))
    for j in range(n):
        A[2 * j, j], A[2 * j + 1, j] = 1.0, -1.0
        A[2 * j : 2 * j + 2, -1] = -scale[j]
    rows = np.abs(f.C).max(axis=1)
    found = linprog(
        np.r_[np.zeros(size), 1.0],
        A,
        np.zeros(2 * n),
        np.column_stack([f.C / rows[:, None], np.zeros(6)]),
        f.q / rows,
        [*zip(f.low, f.high, strict=True), (0, None)],
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return float(found.x[-1]) if found.status == 0 else np.inf


def by_slsqp(f: Full, value, slope, start: np.ndarray) -> np.ndarray:
    """Least of a convex function of the efforts, from a start z near it."""
    rows = np.abs(f.C).max(axis=1)
    n, size = f.n, len(f.low)
    found = minimize(
        lambda z: value(z[:n]),
        start,
        jac=lambda z: np.r_[slope(z[:n]), np.zeros(size - n)],
        bounds=list(zip(f.low, f.high, strict=True)),
        constraints={
            "type": "eq",
            "fun": lambda z: (f.C @ z - f.q) / rows,
            "jac": lambda z: f.C / rows[:, None],
        },
        method="SLSQP",
        options={"maxiter": 2000, "ftol": 1e-15},
    )
    return found.x
