"""The robust solver, one sample at a time: quadratic programs by DAQP, then all digits."""

from __future__ import annotations

from collections.abc import Callable

import daqp
import numpy as np

from .certificate import Answer, certified
from .eliminated import Sample

EQUATION = 5  # DAQP's code of one
TOLERANCES = {"primal_tol": 1e-12, "dual_tol": 1e-12, "iter_limit": 2000}
NEAR = 1e-9  # of a bound: what is this near is at it
SOFT, STEPS = 1e-5, 40  # of programs that follow a curved objective: least curvature; at most
ENDED = 1e-13  # of the greatest effort: a step that ends them

Function = Callable[[np.ndarray], np.ndarray]


def least(s: Sample, slope: Function, curvature: Function, curved: bool) -> Answer | None:
    """The least of a separable convex objective, certified; None where none is found.

    Args: slope, curvature: first and second derivative of one term, of arrays;
          curved: whether curvature changes, so that one quadratic program is not enough.
    """
    if s.contradictory:
        return None
    found = least_squares(s, np.ones(len(s.low)), np.zeros(len(s.low)))
    if found is not None and curved:
        found = _followed(s, slope, curvature, *found)
    if found is None:
        return None
    x, u = found
    for pair in (_polished(s, slope, curvature, x, u), found):
        answer = certified(s, *pair, slope(np.clip(pair[0], s.low, s.high)))
        if answer.proved:
            return answer
    return None


def least_squares(
    s: Sample, curvature: np.ndarray, target: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """x and u of the least of sum curvature (x - target)^2 / 2 + W |y|^2 / 2; None where
    DAQP finds none."""
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
    x, price = np.array(x), -np.asarray(info["lam"])[n:]
    return x, np.concatenate([price[:m], price[m:] + s.weight * (c - B @ x)])


def _followed(
    s: Sample, slope: Function, curvature: Function, x: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Newton's method on the efforts themselves: a quadratic program a step, within all bounds."""
    for _ in range(STEPS):
        bent = curvature(x) + SOFT * np.abs(x).max() + np.finfo(float).tiny
        found = least_squares(s, bent, x - slope(x) / bent)
        if found is None:
            break
        step, u = found[0] - x, found[1]
        # The slope rises along the step: bisect where it vanishes, if that is before its end.
        low, high = 0.0, 1.0
        if slope(x + step) @ step > 0:
            for _ in range(30):
                middle = 0.5 * (low + high)
                above = slope(x + middle * step) @ step > 0
                low, high = (low, middle) if above else (middle, high)
        else:
            low = 1.0
        x = np.maximum(x + low * step, s.low)
        if np.abs(step).max() <= ENDED * np.abs(x).max():
            break
    return x, u


def _polished(
    s: Sample, slope: Function, curvature: Function, x: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """x and u to all digits, from those that are nearly right.

    Newton's method on both at once, with the bounds that are met held as equations: near the
    limit of what is possible multipliers grow, and x does not follow from them alone.
    """
    n, (G, low, high) = len(x), s.whole()
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
