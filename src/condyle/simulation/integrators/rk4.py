"""The classical method of Runge and Kutta, fourth order, with fixed steps.

Between the corners of the efforts steps are equal, and at most `step` long. Between its ends a step
is a cubic through both states and rates, which is of fourth order too.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from .base import Rate, Settings, Step

ROUNDING = 1e-9  # of a step


class RK4:
    """As a compiled loop does it, to be compared with one."""

    fixed: ClassVar[bool] = True

    def __init__(self, rate: Rate, settings: Settings) -> None:
        assert settings.step is not None
        self._rate, self._size = rate, settings.step

    def restart(self, t: float, y: np.ndarray, until: float) -> None:
        count = max(math.ceil((until - t) / self._size - ROUNDING), 1)
        self._start, self._until, self._count, self._done = t, until, count, 0
        self._y, self._f = y, self._rate(t, y)

    def step(self) -> Step:
        k, count = self._done, self._count
        t0 = self._time(k)
        t1 = self._time(k + 1)
        h, y0, f0 = (self._until - self._start) / count, self._y, self._f
        k2 = self._rate(t0 + h / 2, y0 + h / 2 * f0)
        k3 = self._rate(t0 + h / 2, y0 + h / 2 * k2)
        k4 = self._rate(t1, y0 + h * k3)
        y1 = y0 + h / 6 * (f0 + 2 * (k2 + k3) + k4)
        f1 = self._rate(t1, y1)
        self._done, self._y, self._f = k + 1, y1, f1
        return Step(t0, t1, y0, y1, lambda t: hermite((t - t0) / h, h, y0, f0, y1, f1))

    def _time(self, k: int) -> float:
        if k == self._count:
            return self._until
        return self._start + k * ((self._until - self._start) / self._count)


def hermite(
    s: float, h: float, y0: np.ndarray, f0: np.ndarray, y1: np.ndarray, f1: np.ndarray
) -> np.ndarray:
    """The cubic with these values and rates at s = 0 and 1, a step h apart."""
    a = s * s * (3 - 2 * s)
    return y0 + a * (y1 - y0) + h * s * (1 - s) * ((1 - s) * f0 - s * f1)
