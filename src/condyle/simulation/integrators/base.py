"""What an integrator is: steps from a state on, each with what is between its ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

Rate = Callable[[float, np.ndarray], np.ndarray]


class Stuck(Exception):
    """The state has no rate there, or none that the integrator can follow.

    Attributes: status: of `Status`, or None where steps became too small.
    """

    def __init__(self, status: int | None = None) -> None:
        super().__init__(status)
        self.status = status


@dataclass(frozen=True)
class Step:
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
    """rtol: relative tolerance;  atol: (s,), absolute, one a state;  step: of fixed ones [s]."""

    rtol: float
    atol: np.ndarray
    step: float | None = None


class Integrator(Protocol):
    """Made of a rate and settings; restarted wherever the rate has a corner."""

    fixed: ClassVar[bool]  # whether steps are given, and not chosen by the error

    def __init__(self, rate: Rate, settings: Settings) -> None: ...

    def restart(self, t: float, y: np.ndarray, until: float) -> None:
        """Go on from here, to `until` at most."""
        ...

    def step(self) -> Step:
        """The next step.

        Raises: Stuck: where there is none; the state stays at the end of the last one.
        """
        ...
