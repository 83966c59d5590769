"""Quadratic programs one at a time by DAQP, for the samples where Newton's method does not end."""

from __future__ import annotations

import daqp
import numpy as np

from .newton import Answer
from .program import ACTIVE, TOLERANCES, Sample
from .reduced import Reduced


def active_set(r: Reduced) -> Answer:
    """The least of |x|^2 / 2 + W |lambda|^2 / 2, each sample by itself from a cold start."""
    answer = Answer.empty(r.n, r.k, r.count)
    for i in range(r.count):
        s = Sample.of(r, i)
        found = _solve(s, r.weight)
        if found is not None:
            x, u = (a * s.unit for a in found)
            answer.x[:, i], answer.u[:, i] = x, u
            answer.force[:, i] = r.right[r.m :, i] - r.G[r.m :, :, i] @ x
            answer.found[i] = True
    return answer


def _solve(s: Sample, weight: float) -> tuple[np.ndarray, np.ndarray] | None:
    """x and multipliers u of one sample; None where DAQP finds no solution."""
    m, n = s.m, s.G.shape[1]
    B, b, c = s.G[m:], s.right[:m], s.right[m:]
    sense = np.zeros(n + 6, dtype=np.int32)
    sense[n : n + m] = ACTIVE
    x, _, flag, info = daqp.solve(
        np.eye(n) + weight * B.T @ B,
        -weight * B.T @ c,
        np.ascontiguousarray(s.G),
        np.concatenate([s.high, b, c - s.contact_low]),
        np.concatenate([s.low, b, c - s.contact_high]),
        sense,
        **TOLERANCES,
    )
    if flag != 1:
        return None
    price = -np.asarray(info["lam"])[n:]
    return x, np.concatenate([price[:m], price[m:] + weight * (c - B @ x)])
