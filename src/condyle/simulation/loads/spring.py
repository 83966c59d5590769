"""A spring with a damper between a point of the platform and the base, along one direction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from pydantic import Field

from ...mechanism.mechanism import Mechanism
from ..table import Direction, Gain, Length
from .base import BoundLoad, LoadTable


class Spring(LoadTable):
    """force = -(stiffness (x - rest) + damping x') u,   x = u . (p - p_home),

    with u the unit vector along `direction`: it pulls and pushes.
    """

    kind: Literal["spring"]
    direction: Direction = Field(default=(0.0, 0.0, 1.0), description="in {S}")
    stiffness: Gain = Field(description="N/m")
    damping: Gain = Field(default=0.0, description="N s/m")
    rest: Length = Field(default=0.0, description="x at which it does nothing; at home x is 0")

    def bind(self, mechanism: Mechanism, name: str) -> BoundLoad:
        place, point = self.place(mechanism)
        return BoundSpring(
            name, point, place, unit(self.direction), self.stiffness, self.damping, self.rest
        )


@dataclass(frozen=True)
class BoundSpring(BoundLoad):
    knobs: ClassVar[Mapping[str, str]] = {"stiffness": "N/m", "damping": "N s/m", "rest": "m"}

    direction: tuple[float, ...] = (0.0, 0.0, 1.0)
    stiffness: float = 0.0
    damping: float = 0.0
    rest: float = 0.0

    def law(self, t: float, s: Sequence[float], v: Sequence[float], mode: int) -> tuple[float, ...]:
        u = self.direction
        x = u[0] * s[0] + u[1] * s[1] + u[2] * s[2]
        speed = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
        f = -(self.stiffness * (x - self.rest) + self.damping * speed)
        return f * u[0], f * u[1], f * u[2]


def unit(direction: Sequence[float]) -> tuple[float, ...]:
    """The vector, of length 1."""
    length = sum(x * x for x in direction) ** 0.5
    return tuple(x / length for x in direction)
