"""A force and a moment that stay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from ...mechanism.mechanism import Mechanism
from ..table import Vector
from .base import BoundLoad, LoadTable


class Constant(LoadTable):
    """The same force and moment at all times, in {S}."""

    kind: Literal["constant"]
    force: Vector = Field(default=(0.0, 0.0, 0.0), description="N, in {S}")
    moment: Vector = Field(default=(0.0, 0.0, 0.0), description="N m, in {S}")

    def bind(self, mechanism: Mechanism, name: str) -> BoundLoad:
        place, point = (None, np.zeros(3))
        if any(self.force) or self.point is not None:
            place, point = self.place(mechanism)
        return BoundConstant(name, point, place, (*self.force, *self.moment))


@dataclass(frozen=True)
class BoundConstant(BoundLoad):
    """wrench: force and moment, (6,) [N, N m]."""

    wrench: tuple[float, ...] = (0.0,) * 6

    def law(self, t: float, s: Sequence[float], v: Sequence[float], mode: int) -> tuple[float, ...]:
        return self.wrench
