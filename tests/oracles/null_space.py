"""Least efforts by active sets, enumerated in the null space of the equations: slow and plain.

    E y = b,    least sum cost y^2 / 2 within bounds of y = (effort, lambda)

All that meets the equations is y0 + Z z. Of all choices of bounds that hold with equality, at most
as many as z has entries, each gives one z; the best of those within the other bounds is the answer.
"""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

Array = np.ndarray
WITHIN = 1e-9  # of the largest entry, by which a bound may be exceeded


def least(
    E: Array, b: Array, low: Array, high: Array, cost: Array, within: float = WITHIN
) -> tuple[float, Array] | None:
    """Half the weighted sum of squares and y; None where no point is within the bounds.

    Args: E: (6, n + k);  b: (6,);  low, high: (n + k,), infinite where there is none.
    """
    if (low > high).any():
        return None
    U, sigma, Vt = np.linalg.svd(E)
    assert sigma[-1] > 1e-10 * sigma[0]
    y0, Z = Vt[:6].T @ ((U.T @ b) / sigma), Vt[6:].T
    root, wide = np.sqrt(cost)[:, None], Z.shape[1]
    bounds = [(i, v) for i, pair in enumerate(zip(low, high, strict=True)) for v in {*pair}]
    bounds = [(i, v) for i, v in bounds if np.isfinite(v)]
    best = None
    for size in range(wide + 1):
        for active in combinations(bounds, size):
            rows = [i for i, _ in active]
            if len(set(rows)) < size:
                continue
            fixed, right = Z[rows], np.array([v for _, v in active]) - y0[rows]
            if size and np.linalg.matrix_rank(fixed, tol=1e-9) < size:
                continue
            start = np.linalg.lstsq(fixed, right, rcond=None)[0] if size else np.zeros(wide)
            free = np.linalg.svd(fixed)[2][size:].T if size else np.eye(wide)
            # What costs nothing (forces that balance each other) stays as it is.
            move = np.linalg.lstsq(root * (Z @ free), -root[:, 0] * (y0 + Z @ start), rcond=None)[0]
            y = y0 + Z @ (start + free @ move)
            slack = within * np.abs(y).max()
            if (y < low - slack).any() or (y > high + slack).any():
                continue
            value = 0.5 * float(cost @ y**2)
            if best is None or value < best[0]:
                best = value, y
    return best


def least_of_patterns(
    J: Array, N: Array, T: Array, b: Array, low: Array, high: Array
) -> tuple[float, Array] | None:
    """Least |effort|^2 with friction: J^T effort + (N - sigma T)^T lambda = b, where sigma are the
    signs of the contact forces."""
    n, found = len(J), []
    cost = np.repeat([1.0, 0.0], [n, len(N)])
    rubs = [bool(np.any(row)) for row in T]
    for signs in product(*[(1, -1) if rub else (0,) for rub in rubs]):
        sigma = np.array(signs, dtype=float)
        below, above = low.copy(), high.copy()
        below[n:] = np.where(sigma > 0, np.maximum(low[n:], 0), low[n:])
        above[n:] = np.where(sigma < 0, np.minimum(high[n:], 0), high[n:])
        E = np.vstack([J, N - sigma[:, None] * T]).T
        found.append(least(E, b, below, above, cost))
    answers = [one for one in found if one is not None]
    return min(answers, key=lambda one: one[0]) if answers else None
