"""Proof of an answer from its numbers alone: equations, constraints, conditions of optimality."""

from __future__ import annotations

import numpy as np

from .law import Law
from .newton import Answer
from .reduced import Reduced
from .result import CERTIFIED

AT_BOUND = CERTIFIED  # of the largest effort: this near a bound, a multiplier may act


def ratio(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """part / whole, 0 where both are."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(part == 0, 0.0, part / whole)


def residual(r: Reduced, answer: Answer) -> np.ndarray:
    """How far the equations are from met, (R,): relative to the terms of each kind of row."""
    force = np.concatenate([np.zeros((r.m, r.count)), answer.force])
    products = r.G * answer.x
    error = np.abs(r.right - products.sum(axis=1) - force)
    x = np.abs(answer.x).max(axis=0, initial=0.0)
    steepest, known = r.size
    size = steepest * x
    size = np.where(size > 0, size, known + np.abs(force))
    return ratio(error, size).max(axis=0)


def excess(r: Reduced, answer: Answer) -> np.ndarray:
    """How far efforts and contact forces exceed their bounds, (R,), relative to the largest."""
    x, force = answer.x, answer.force
    largest = np.abs(x).max(axis=0, initial=0.0)
    over = np.maximum(r.low - x, x - r.high).max(axis=0, initial=0.0)
    beyond = np.maximum(r.contact_low - force, force - r.contact_high).max(axis=0, initial=0.0)
    return np.maximum(
        ratio(over, largest), ratio(beyond, np.abs(force).max(axis=0, initial=0.0) + largest)
    )


def slack(r: Reduced, law: Law, answer: Answer) -> np.ndarray:
    """The part of the gradient that no multiplier of the right sign explains, (R,), relative."""
    x, force, s = answer.x, answer.force, answer.u[r.m :]
    slope = law.slope(x)
    g = (r.G * answer.u[:, None]).sum(axis=0)
    largest = np.abs(slope).max(axis=0, initial=0.0)
    largest = np.where(largest > 0, largest, np.abs(g).max(axis=0, initial=0.0))
    wrong = _wrong(slope - g, x, r.low, r.high, np.abs(x).max(axis=0, initial=0.0))
    worst = ratio(wrong.max(axis=0, initial=0.0), largest)
    if r.k:
        # A multiplier of a contact counts by what it adds to the price of efforts.
        size = np.abs(force).max(axis=0) + np.abs(x).max(axis=0, initial=0.0)
        wrong = _wrong(r.weight * force - s, force, r.contact_low, r.contact_high, size)
        effect = r.size[0][r.m :]
        worst = np.maximum(worst, ratio((wrong * effect).max(axis=0), largest))
    return worst


def _wrong(
    z: np.ndarray, x: np.ndarray, low: np.ndarray, high: np.ndarray, largest: np.ndarray
) -> np.ndarray:
    """|z| where no bound is near, and where z has the sign that the bound cannot give."""
    near = AT_BOUND * largest
    up, down = np.maximum(z, 0.0), np.maximum(-z, 0.0)
    return np.maximum(np.where(x - low <= near, 0.0, up), np.where(high - x <= near, 0.0, down))


def settle(r: Reduced, law: Law, answer: Answer) -> Answer:
    """The answer with bounds met exactly, `found` only where it is proved to be least."""
    answer.x = np.minimum(np.maximum(answer.x, r.low), r.high)
    answer.error = slack(r, law, answer)
    return accept(r, answer)


def accept(r: Reduced, answer: Answer) -> Answer:
    """`found` only where equations, constraints and the conditions of optimality are met."""
    with np.errstate(invalid="ignore"):
        answer.residual, answer.excess = residual(r, answer), excess(r, answer)
        parts = (answer.residual, answer.excess, answer.error)
        answer.found &= np.all([part <= CERTIFIED for part in parts], axis=0)
    return answer
