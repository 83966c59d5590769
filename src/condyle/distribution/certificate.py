"""Certificates of optimality: the Karush-Kuhn-Tucker conditions, checked on the result alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .eliminated import Sample
from .result import CERTIFIED


@dataclass(frozen=True)
class Optimum:
    """x and contact forces y of a sample, multipliers u (6,) of its equations, and its certificate.

    residual, excess, slack: relative residual of the equations, violation of the bounds, and
    violation of stationarity with multipliers of the right sign.
    """

    x: np.ndarray
    force: np.ndarray
    u: np.ndarray
    residual: float
    excess: float
    slack: float

    @property
    def proved(self) -> bool:
        return max(self.residual, self.excess, self.slack) <= CERTIFIED


def certified(
    s: Sample, x: np.ndarray, u: np.ndarray, slope: np.ndarray, slack: float | None = None
) -> Optimum:
    """The certified answer, its efforts clipped to their limits.

    Args: slope: gradient of the objective in x;  slack: if it is already known.
    """
    x = np.clip(x, s.low, s.high)
    force = s.force(x)
    known = _slack(s, x, force, u, slope) if slack is None else slack
    return Optimum(x, force, u, residual(s, x, force), excess(s, x, force), known)


def residual(s: Sample, x: np.ndarray, force: np.ndarray) -> float:
    """Residual of the equations, relative to the terms of each kind of row."""
    G, *_ = s.complete()
    error = np.abs(s.right - G @ np.concatenate([x, force]))
    size = np.abs(s.G).max(axis=1, initial=0.0) * np.abs(x).max(initial=0.0)
    others = np.abs(s.right) + np.concatenate([np.zeros(s.m), np.abs(force)])
    return float(_ratio(error, np.where(size > 0, size, others)).max())


def excess(s: Sample, x: np.ndarray, force: np.ndarray) -> float:
    """Violation of the bounds of efforts and contact forces, relative to the largest."""
    largest = np.abs(x).max(initial=0.0)
    over = np.maximum(s.low - x, x - s.high).max(initial=0.0)
    beyond = np.maximum(s.contact_low - force, force - s.contact_high).max(initial=0.0)
    parts = _ratio(over, largest), _ratio(beyond, np.abs(force).max(initial=0.0) + largest)
    return float(max(parts))


def _slack(s: Sample, x: np.ndarray, force: np.ndarray, u: np.ndarray, slope: np.ndarray) -> float:
    g, greatest = s.G.T @ u, np.abs(x).max(initial=0.0)
    largest = np.abs(slope).max(initial=0.0) or np.abs(g).max(initial=0.0)
    wrong = unexplained(slope - g, x, s.low, s.high, greatest)
    # A contact's multiplier counts by its contribution to the gradient of efforts.
    size = np.abs(force).max(initial=0.0) + greatest
    z = s.weight * force - u[s.m :]
    acting = unexplained(z, force, s.contact_low, s.contact_high, size)
    effect = acting * np.abs(s.G[s.m :]).max(axis=1, initial=0.0)
    return float(_ratio(max(wrong.max(initial=0.0), effect.max(initial=0.0)), largest))


def unexplained(
    z: np.ndarray, x: np.ndarray, low: np.ndarray, high: np.ndarray, largest: float
) -> np.ndarray:
    """|z| where no bound is active, and where z has the wrong sign for the active bound."""
    near = CERTIFIED * largest
    up, down = np.maximum(z, 0.0), np.maximum(-z, 0.0)
    return np.maximum(np.where(x - low <= near, 0.0, up), np.where(high - x <= near, 0.0, down))


def _ratio(part: np.ndarray | float, whole: np.ndarray | float) -> np.ndarray:
    """part / whole, 0 where both are."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.equal(part, 0), 0.0, np.divide(part, whole))
