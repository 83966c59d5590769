"""Integrators by name: steps from a state on, each with what is between its ends.

`rk4` has fixed steps, which compiled code takes as well, by the same coefficients. The others are
SciPy's, whose error is held below a tolerance: explicit DOP853, and implicit Radau for stiff
springs and friction with a small smoothing speed (Hairer, Norsett and Wanner, Solving Ordinary
Differential Equations I; Hairer and Wanner, II).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

Rate = Callable[[float, np.ndarray], np.ndarray]

# The classical method of Runge and Kutta, of fourth order: rows of coefficients; the last makes y.
RUNGE_KUTTA = ((1 / 2,), (0, 1 / 2), (0, 0, 1), (1 / 6, 1 / 3, 1 / 3, 1 / 6))
ROUNDING = 1e-9  # of a step
LONGEST = 0.01  # seconds a step, so that events between its ends are not passed over
SHORTEST = 1e-7  # seconds
SHRINK = 0.25
FIRST = 10  # of the shortest step: tried first after a breakpoint, at the least
RECOVERED = 1e-4  # seconds: after such a step the integrator is clear of states without a rate


class NoRateError(Exception):
    """The state has no rate there, or none that the integrator can follow.

    Attributes: status: of `Status`, or None where steps became too small.
    """

    def __init__(self, status: int | None = None) -> None:
        super().__init__(status)
        self.status = status


@dataclass(frozen=True)
class IntegrationStep:
    """A step from t0 to t1.

    at: (t,) -> the state between its ends.
    """

    t0: float
    t1: float
    y0: np.ndarray
    y1: np.ndarray
    at: Callable[[float], np.ndarray]


@dataclass(frozen=True)
class Settings:
    """rtol: relative tolerance;  atol: (s,), absolute, one a state;  step: of fixed ones [s].

    shortest: [s], a run that needs shorter steps is at its end.
    """

    rtol: float
    atol: np.ndarray
    step: float | None = None
    shortest: float = SHORTEST


class RK4:
    """Between the breakpoints of the efforts steps are equal, and at most `step` long.

    Between its ends a step is a cubic through both states and rates, of fourth order too.
    """

    fixed: ClassVar[bool] = True  # whether steps are given, and not chosen by the error

    def __init__(self, rate: Rate, settings: Settings) -> None:
        assert settings.step is not None
        self._rate, self._size = rate, settings.step

    def restart(self, t: float, y: np.ndarray, until: float) -> None:
        """Go on from here, to `until` at most: the next breakpoint."""
        self._count = max(math.ceil((until - t) / self._size - ROUNDING), 1)
        self._start, self._until, self._done = t, until, 0
        self._y, self._f = y, self._rate(t, y)

    def step(self) -> IntegrationStep:
        """The next step.

        Raises: NoRateError: where there is none; the state stays at the end of the last one.
        """
        h, y0, f0 = (self._until - self._start) / self._count, self._y, self._f
        t0, t1 = self._time(self._done), self._time(self._done + 1)
        k = [f0]
        for row in RUNGE_KUTTA:
            y = y0 + sum(h * a * f for a, f in zip(row, k, strict=True) if a)
            k.append(self._rate(t1 if sum(row) > 0.9 else t0 + sum(row) * h, y))
        y1, f1 = y, k[-1]
        self._done, self._y, self._f = self._done + 1, y1, f1
        return IntegrationStep(t0, t1, y0, y1, lambda t: hermite((t - t0) / h, h, y0, f0, y1, f1))

    def correct(self, y: np.ndarray) -> None:
        """Go on from another state at the end of the last step."""
        self._y, self._f = y, self._rate(self._time(self._done), y)

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


class Adaptive:
    """One of SciPy's solvers, restarted between breakpoints without a search for its first step."""

    fixed: ClassVar[bool] = False

    def __init__(self, solver: str, rate: Rate, settings: Settings) -> None:
        import scipy.integrate

        self._solver: Any = getattr(scipy.integrate, solver)
        self._rate, self._settings = rate, settings
        self._size: float | None = None
        self._running: Any = None
        self._status: int | None = None  # of states without a rate that steps have met

    def restart(self, t: float, y: np.ndarray, until: float) -> None:
        """As of `RK4`."""
        self._until = until
        # What was left before a breakpoint may be short, which says nothing of the error.
        least = FIRST * self._settings.shortest
        self._begin(t, y, None if self._size is None else max(self._size, least))

    def _begin(self, t: float, y: np.ndarray, size: float | None) -> None:
        first = None if size is None else min(size, self._until - t)
        self._running = self._solver(
            self._rate,
            t,
            y,
            self._until,
            max_step=LONGEST,
            rtol=self._settings.rtol,
            atol=self._settings.atol,
            first_step=first,
        )

    def step(self) -> IntegrationStep:
        """As of `RK4`."""
        running = self._running
        t0, y0 = running.t, running.y
        while True:
            size = running.h_abs
            try:
                problem = running.step()
                break
            except NoRateError as error:
                self._status = error.status
                size = min(size, self._until - t0) * SHRINK
                if size < self._settings.shortest:
                    raise
                self._begin(t0, y0, size)
                running = self._running
        length = running.t - t0
        if problem is not None or (length < self._settings.shortest and running.t < self._until):
            raise NoRateError(self._status_ahead())
        if length > RECOVERED:
            self._status = None
        self._size = running.h_abs
        dense: list[Any] = []

        def at(t: float) -> np.ndarray:
            if not dense:
                dense.append(running.dense_output())
            return dense[0](t)

        return IntegrationStep(t0, running.t, y0, running.y, at)

    def correct(self, y: np.ndarray) -> None:
        """As of `RK4`."""
        running = self._running
        running.y, running.f = y, self._rate(running.t, y)

    def _status_ahead(self) -> int | None:
        """Why steps are so short: the status of a state without a rate that is near, if any is."""
        running = self._running
        try:
            for size in np.geomspace(SHORTEST, LONGEST, 6):
                self._rate(running.t + size, running.y + size * running.f)
        except NoRateError as error:
            return error.status
        return self._status


INTEGRATORS = ("DOP853", "Radau", "rk4")
FIXED = ("rk4",)  # those with a step of their own


def integrator(method: str, rate: Rate, settings: Settings) -> RK4 | Adaptive:
    """The one of that name."""
    return RK4(rate, settings) if method in FIXED else Adaptive(method, rate, settings)
