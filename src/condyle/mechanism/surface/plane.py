"""A plane, the paper's contact surface."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np

from ..quantities import Length, Number
from .base import Coordinates, Scalar, SurfaceTable
from .freedom import Freedom, tangents


class Plane(SurfaceTable):
    """z = slope[0] x + slope[1] y + offset, [Cheng2023] eq. (1)."""

    kind: Literal["plane"] = "plane"
    slope: tuple[Number, Number]
    offset: Length

    flat: ClassVar[bool] = True

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        return point[2] - c[0] * point[0] - c[1] * point[1] - c[2]

    def constants(self) -> tuple[float, ...]:
        return (*self.slope, self.offset)

    @staticmethod
    def from_numbers(f: Any) -> ca.SX:
        return ca.vertcat(f.slope, f.offset)

    def joints(self, point: np.ndarray, normal: np.ndarray) -> tuple[Freedom, ...]:
        u, v = tangents(normal)
        return Freedom("slide", u, point), Freedom("slide", v, point)

    @staticmethod
    def beyond(f: Any, distance: ca.SX) -> Any:
        steepness = ca.sqrt(1 + ca.dot(f.slope, f.slope))
        return SimpleNamespace(slope=f.slope, offset=f.offset + distance * steepness)
