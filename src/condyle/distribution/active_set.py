"""The robust solver, one sample at a time: quadratic programs by DAQP, polished by Newton."""

from __future__ import annotations

from collections.abc import Callable

import daqp
import numpy as np

from .certificate import Optimum, certified
from .eliminated import Sample

EQUATION = 5  # DAQP's code of one
TOLERANCES = {"primal_tol": 1e-12, "dual_tol": 1e-12, "iter_limit": 2000}
NEAR = 1e-9  # distance within which a bound is active
SOFT, STEPS = 1e-5, 40  # sequential quadratic programming: minimum curvature, maximum steps
CONVERGED = 1e-13  # relative step that ends it

Function = Callable[[np.ndarray], np.ndarray]


def least(s: Sample, slope: Function, curvature: Function, curved: bool) -> Optimum | None:
    """Minimise a separable convex objective; None where no certified minimum is found.

    Args: slope, curvature: first and second derivative of one term, of arrays;
          curved: whether the curvature varies, so that one quadratic program is not enough.
    """
    if s.contradictory:
        return None
    optimum = least_squares(s, np.ones(len(s.low)), np.zeros(len(s.low)))
    if optimum is not None and curved:
        optimum = _followed(s, slope, curvature, *optimum)
    if optimum is None:
        return None
    x, u = optimum
    for pair in (_polished(s, slope, curvature, x, u), optimum):
        answer = certified(s, *pair, slope(np.clip(pair[0], s.low, s.high)))
        if answer.proved:
            return answer
    return None


def least_squares(
    s: Sample, curvature: np.ndarray, target: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """x and u that minimise sum curvature (x - target)^2 / 2 + W |y|^2 / 2; None if DAQP fails."""
    m, n = s.m, s.G.shape[1]
    B, b, c = s.G[m:], s.right[:m], s.right[m:]
    sense = np.zeros(n + 6, dtype=np.int32)
    sense[n : n + m] = EQUATION
    x, _, flag, info = daqp.solve(
        np.diag(curvature) + s.weight * B.T @ B,
        -curvature * target - s.weight * B.T @ c,
        np.ascontiguousarray(s.G),
        np.concatenate([s.high, b, c - s.contact_low]),
        np.concatenate([s.low, b, c - s.contact_high]),
        sense,
        **TOLERANCES,
    )
    if flag != 1:
        return None
    x, u = np.array(x), -np.asarray(info["lam"])[n:]
    return x, np.concatenate([u[:m], u[m:] + s.weight * (c - B @ x)])


def _followed(
    s: Sample, slope: Function, curvature: Function, x: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Sequential quadratic programming from x and u."""
    for _ in range(STEPS):
        bent = curvature(x) + SOFT * np.abs(x).max() + np.finfo(float).tiny
        found = least_squares(s, bent, x - slope(x) / bent)
        if found is None:
            break
        step, u = found[0] - x, found[1]
        # Line search: the slope rises along the step, so bisect for its root.
        low, high = 0.0, 1.0
        if slope(x + step) @ step > 0:
            for _ in range(30):
                middle = 0.5 * (low + high)
                above = slope(x + middle * step) @ step > 0
                low, high = (low, middle) if above else (middle, high)
        else:
            low = 1.0
        x = np.maximum(x + low * step, s.low)
        if np.abs(step).max() <= CONVERGED * np.abs(x).max():
            break
    return x, u


def _polished(
    s: Sample, slope: Function, curvature: Function, x: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """x and u to rounding, by Newton's method on both with the active bounds as equations.

    Near infeasibility multipliers grow, and x does not follow from them alone.
    """
    n, (G, low, high) = len(x), s.complete()
    z, u = np.clip(np.concatenate([x, s.force(x)]), low, high), u.copy()
    z = np.where(z <= low + NEAR, low, np.where(z >= high - NEAR, high, z))
    free = (z > low) & (z < high)
    weights = np.full(len(z) - n, s.weight)
    for _ in range(4):
        gradient = np.concatenate([slope(z[:n]), weights * z[n:]])
        bent = np.concatenate([curvature(z[:n]), weights])
        part, count = G[:, free], int(free.sum())
        K = np.block([[np.diag(bent[free]), -part.T], [part, np.zeros((6, 6))]])
        wrong = np.concatenate([part.T @ u - gradient[free], s.right - G @ z])
        change = np.linalg.lstsq(K, wrong)[0]
        z[free] += change[:count]
        u += change[count:]
    return z[:n], u
