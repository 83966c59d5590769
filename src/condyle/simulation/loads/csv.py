"""A force and a moment over time, from a table, linear between its rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from pydantic import Field

from ...mechanism.mechanism import Mechanism
from ...motion import Load
from ..table import File
from .base import BoundLoad, LoadTable


class Csv(LoadTable):
    """A table of t and some of Fx, Fy, Fz, Mx, My, Mz, as of `condyle run --load`.

    Before its first row and after its last there is no load.
    """

    kind: Literal["csv"]
    file: File = Field(description="t [s], Fx, Fy, Fz [N], Mx, My, Mz [N m], in {S}")

    def bind(self, mechanism: Mechanism, name: str) -> BoundLoad:
        load = Load.from_csv(self.file)
        place, point = self.place(mechanism)
        return BoundTable(name, point, place, load.t, load.wrench)


@dataclass(frozen=True)
class BoundTable(BoundLoad):
    """times: (N,) [s];  wrench: (N, 6) [N, N m]."""

    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    wrench: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))

    def law(self, t: float, s: Sequence[float], v: Sequence[float], mode: int) -> tuple[float, ...]:
        times = self.times
        i = int(np.searchsorted(times, t, side="right"))
        if i == 0 or (i == len(times) and t > times[-1]):
            return (0.0,) * 6
        i = min(i, len(times) - 1)
        part = (t - times[i - 1]) / (times[i] - times[i - 1])
        return tuple((self.wrench[i - 1] + part * (self.wrench[i] - self.wrench[i - 1])).tolist())

    def breaks(self, t0: float, t1: float) -> np.ndarray:
        return self.times[(self.times >= t0) & (self.times <= t1)]
