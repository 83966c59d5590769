"""What a load is: a table of the scenario file, and a law on the Builder.

    force = wrench(s, v, mode, numbers),   s = p - p_home, v = p',

in {S}, with p its point. The mode is a number that only guards change: each stays below zero while
its mode lasts, and where it passes zero its jump says what happens.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from pydantic import Field

from ...mechanism.quantities import LoadPoint, Name
from ...mechanism.table import Table
from ..entries import Machine

WRENCH = "wrench"  # a port that is fed over time, (6,)


@dataclass(frozen=True)
class Jump:
    """What a load does where its guard passes zero: a new mode, and the event's kind and text."""

    mode: int
    kind: str
    text: str


@dataclass(frozen=True)
class LoadPlace:
    """Where a load's point is: displacement s and velocity v, (3,) each; its mode, its numbers."""

    s: Any
    v: Any
    mode: Any
    numbers: Any


class LoadTable(Table):
    """A `[[load]]`; its `kind` says which.

    Of a kind of its own: `ports` and their sizes, what `given` says for them, and `wrench`.
    """

    ports: ClassVar[Mapping[str, int]] = {}
    # The mode in which it can bear a force that is held on it, if there is one.
    bears: ClassVar[int | None] = None
    # Ports that are divided among the points of a load that acts at several.
    divided: ClassVar[tuple[str, ...]] = ()
    # Numbers that may change while it runs, with their units.
    parameters: ClassVar[Mapping[str, str]] = {}

    kind: Any
    name: Name | None = None
    point: LoadPoint | None = Field(
        default=None,
        description='of the platform, or "x,y,z" [m] in {M}; at several, separated by ";", equal '
        "parts act",
    )

    def given(self, machine: Machine) -> Mapping[str, Any]:
        """What its ports are given, by name: the table's own entries."""
        return {name: getattr(self, name) for name in self.ports}

    @staticmethod
    @abstractmethod
    def wrench(at: LoadPlace) -> ca.SX:
        """Force (3,) [N] on the platform at the point, or force and moment (6,) [N, N m]."""

    @staticmethod
    def guards(at: LoadPlace) -> Sequence[tuple[int, ca.SX]]:
        """Guards: in which mode, and what stays below zero in it, one a jump."""
        return ()

    @staticmethod
    def jumps(numbers: Any) -> Sequence[Jump]:
        """What happens where the guards pass zero, in their order; `{force}`: the load's then."""
        return ()

    @staticmethod
    def begin(at: LoadPlace) -> Any:
        """The mode to begin with."""
        return 0

    def bind(self, machine: Machine, name: str) -> ActingLoad:
        """The load on a mechanism.

        Raises: InputError: where it does not fit.
        """
        place, point = machine.point(self.point)
        numbers = {n: np.array(v, dtype=float) for n, v in self.given(machine).items()}
        return ActingLoad(type(self), name, point, place, numbers)


@dataclass(frozen=True)
class ActingLoad:
    """A load at a point (3,) [m] of {M}, of that name; numbers of its ports by name.

    times, rows: (N,) [s] and (N, 6), what `WRENCH` is between them, linearly; none outside.
    """

    law: type[LoadTable]
    name: str
    point: np.ndarray
    place: str | None = None
    numbers: dict[str, np.ndarray] = field(default_factory=dict)
    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rows: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))

    @property
    def parameters(self) -> Mapping[str, str]:
        """Numbers that may change while it runs, with their units."""
        return self.law.parameters

    @property
    def jumps(self) -> Sequence[Jump]:
        """One a guard."""
        return self.law.jumps(SimpleNamespace(**self.numbers))

    def part(self, count: int) -> ActingLoad:
        """One of so many equal parts of it, each at a point of its own."""
        divided = self.law.divided
        numbers = {n: v / count if n in divided else v for n, v in self.numbers.items()}
        rows = self.rows / count if WRENCH in divided else self.rows
        return replace(self, numbers=numbers, rows=rows)

    def begin(self, s: np.ndarray) -> int:
        """The mode to begin with, the point being displaced by s, (3,) [m]."""
        numbers = SimpleNamespace(**{n: ca.DM(v) for n, v in self.numbers.items()})
        return int(self.law.begin(LoadPlace(ca.DM(s), ca.DM.zeros(3), ca.DM(0), numbers)))
