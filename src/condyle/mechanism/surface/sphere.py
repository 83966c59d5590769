"""A sphere: a ball joint's socket, or a dome."""

from __future__ import annotations

from typing import ClassVar, Literal

from ..quantities import Point, PositiveLength
from .base import Coordinates, Scalar, SurfaceTable


class Sphere(SurfaceTable):
    """|p - centre| = radius, as phi = (|p - centre|^2 / radius - radius) / 2.

    No square root: on the surface the gradient is the unit normal, and its derivative constant.
    """

    kind: Literal["sphere"] = "sphere"
    centre: Point
    radius: PositiveLength

    closed: ClassVar[bool] = True

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
        return ((x * x + y * y + z * z) / c[3] - c[3]) / 2

    def constants(self) -> tuple[float, ...]:
        return (*self.centre, self.radius)

    def parallel(self, distance: float, point: Coordinates) -> Sphere:
        return self.model_copy(update={"radius": self.radius + distance})
