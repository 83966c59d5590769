"""A spring with a damper between a point of the platform and the base, along one direction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import casadi as ca
from pydantic import Field

from ...mechanism.quantities import Direction, Length
from ..entries import Gain, Machine, unit
from .acting import LoadPlace, LoadTable


class Spring(LoadTable):
    """force = -(stiffness (x - rest) + damping x') u,   x = u . (p - p_home),

    with u the unit vector along `direction`: it pulls and pushes.
    """

    ports: ClassVar[Mapping[str, int]] = {"direction": 3, "stiffness": 1, "damping": 1, "rest": 1}
    divided: ClassVar[tuple[str, ...]] = ("stiffness", "damping")
    bears: ClassVar[int | None] = 0
    parameters: ClassVar[Mapping[str, str]] = {"stiffness": "N/m", "damping": "N s/m", "rest": "m"}

    kind: Literal["spring"]
    direction: Direction = Field(default=(0.0, 0.0, 1.0), description="in {S}")
    stiffness: Gain = Field(description="N/m")
    damping: Gain = Field(default=0.0, description="N s/m")
    rest: Length = Field(default=0.0, description="x at which it does nothing; at home x is 0")

    def given(self, machine: Machine) -> Mapping[str, Any]:
        return {**super().given(machine), "direction": unit(self.direction)}

    @staticmethod
    def wrench(at: LoadPlace) -> ca.SX:
        n, u = at.numbers, at.numbers.direction
        return -(n.stiffness * (ca.dot(u, at.s) - n.rest) + n.damping * ca.dot(u, at.v)) * u
