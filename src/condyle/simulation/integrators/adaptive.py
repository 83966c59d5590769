"""SciPy's integrators, whose error is held below a tolerance: explicit DOP853, implicit Radau.

(Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I; Hairer and Wanner, II.)
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from scipy.integrate import DOP853 as ScipyDOP853
from scipy.integrate import Radau as ScipyRadau

from .base import Rate, Settings, Step, Stuck

LONGEST = 0.01  # seconds a step, so that events between its ends are not passed over
SHORTEST = 1e-10  # seconds: where a state has no rate within such a step, it is at its end
SHRINK = 0.25


class Adaptive:
    """One of SciPy's solvers, restarted between corners without a search for its first step."""

    fixed: ClassVar[bool] = False
    solver: ClassVar[Any]

    def __init__(self, rate: Rate, settings: Settings) -> None:
        self._rate, self._settings = rate, settings
        self._size: float | None = None
        self._running: Any = None

    def restart(self, t: float, y: np.ndarray, until: float) -> None:
        self._until = until
        self._begin(t, y, self._size)

    def _begin(self, t: float, y: np.ndarray, size: float | None) -> None:
        first = None if size is None else min(size, self._until - t)
        self._running = self.solver(
            self._rate,
            t,
            y,
            self._until,
            max_step=LONGEST,
            rtol=self._settings.rtol,
            atol=self._settings.atol,
            first_step=first,
        )

    def step(self) -> Step:
        running = self._running
        t0, y0 = running.t, running.y
        while True:
            size = running.h_abs
            try:
                problem = running.step()
                break
            except Stuck:
                size = min(size, self._until - t0) * SHRINK
                if size < SHORTEST:
                    raise
                self._begin(t0, y0, size)
                running = self._running
        if problem is not None:
            raise Stuck
        self._size = running.h_abs
        dense: list[Any] = []

        def at(t: float) -> np.ndarray:
            if not dense:
                dense.append(running.dense_output())
            return dense[0](t)

        return Step(t0, running.t, y0, running.y, at)


class DOP853(Adaptive):
    """Eighth order; for anything that is not stiff."""

    solver = ScipyDOP853


class Radau(Adaptive):
    """Fifth order, implicit: for stiff springs, and friction with a small smoothing speed."""

    solver = ScipyRadau
