"""A round cylinder without ends: a groove, or a roller."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from pydantic import Field

from ..quantities import Direction, Point, PositiveLength
from .base import Coordinates, Scalar, SurfaceTable


class Cylinder(SurfaceTable):
    """|axis x (p - point)| = radius with a unit axis, written as `Sphere` is."""

    kind: Literal["cylinder"] = "cylinder"
    point: Point = Field(description="a point of the axis, in {S}")
    axis: Direction = Field(description="direction of the axis, in {S}")
    radius: PositiveLength

    closed: ClassVar[bool] = True

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
        u, v, w = c[3], c[4], c[5]
        i, j, k = v * z - w * y, w * x - u * z, u * y - v * x
        return ((i * i + j * j + k * k) / c[6] - c[6]) / 2

    def constants(self) -> tuple[float, ...]:
        length = math.hypot(*self.axis)
        return (*self.point, *(a / length for a in self.axis), self.radius)

    def parallel(self, distance: float, point: Coordinates) -> Cylinder:
        return self.model_copy(update={"radius": self.radius + distance})
