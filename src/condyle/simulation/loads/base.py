"""What a load of a scenario is: a table of the file, and what it becomes on a mechanism."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...errors import InputError
from ...mechanism.mechanism import Mechanism
from ...motion import resolve_load_point
from ..table import Name, Table


@dataclass(frozen=True)
class Jump:
    """What a load does where its guard passes zero from below: a new mode, and what to tell.

    kind: of the event, empty where it is none to tell;  text: for people.
    """

    mode: int
    kind: str = ""
    text: str = ""


@dataclass(frozen=True)
class BoundLoad(ABC):
    """A load at a point of one mechanism.

    A law of few numbers, so that it can be written in C as well:

        force = law(t, s, v, mode),   s = p - p_home, v = p',

    in {S}, with p the point. The mode is an integer that only guards change. `knobs`: numbers that
    a hand may turn while it runs, with their units.
    """

    knobs: ClassVar[Mapping[str, str]] = {}

    name: str
    point: np.ndarray
    place: str | None = None  # name of the point

    def begin(self, s: Sequence[float]) -> int:
        """The mode to begin with, at s."""
        return 0

    @abstractmethod
    def law(self, t: float, s: Sequence[float], v: Sequence[float], mode: int) -> tuple[float, ...]:
        """Force (3,) [N] on the platform at the point, and, if it has one, a moment (3,) [N m]."""

    def guards(
        self, t: float, s: Sequence[float], v: Sequence[float], mode: int
    ) -> Sequence[float]:
        """What stays below zero in this mode, one a jump of `jumps(mode)`."""
        return ()

    def jumps(self, mode: int) -> Sequence[Jump]:
        """What happens where a guard of this mode becomes positive."""
        return ()

    def breaks(self, t0: float, t1: float) -> np.ndarray:
        """Times between which the force is smooth in t, within [t0, t1] [s]."""
        return np.empty(0)


class LoadTable(Table):
    """A `[[load]]`; its `kind` says which."""

    kind: Any
    name: Name | None = None
    point: Name | None = None

    @abstractmethod
    def bind(self, mechanism: Mechanism, name: str) -> BoundLoad:
        """The load on a mechanism.

        Raises: InputError: where it does not fit.
        """

    def place(self, mechanism: Mechanism) -> tuple[str, np.ndarray]:
        """Name of the point it acts at, and where that is in {M}, (3,) [m]."""
        points = mechanism.platform.points
        name = resolve_load_point(self.point, points)
        return name, np.array(points[name])


def fail(name: str, text: str) -> InputError:
    return InputError(f'load "{name}": {text}')
