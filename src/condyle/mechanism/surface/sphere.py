"""A sphere: a ball joint's socket, or a dome."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from ..quantities import Point, PositiveLength
from .base import Coordinates, Scalar, SurfaceTable
from .quadric import about_itself


class Sphere(SurfaceTable):
    """|p - centre| = radius, as phi = (|p - centre|^2 - radius^2) / (2 radius).

    No square root: on the surface the gradient is the unit normal, and its derivative constant.
    It is written about a point of the sphere, as `quadric` says.
    """

    kind: Literal["sphere"] = "sphere"
    centre: Point
    radius: PositiveLength

    closed: ClassVar[bool] = True

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
        return x * (c[7] * x + c[3]) + y * (c[7] * y + c[4]) + z * (c[7] * z + c[5]) + c[6]

    def constants(self) -> tuple[float, ...]:
        """A point of the sphere, its unit normal, phi there, and 1 / (2 radius)."""
        A = np.eye(3) / (2 * self.radius)
        return about_itself(A, np.array(self.centre), self.radius / 2)[:8]

    def parallel(self, distance: float, point: Coordinates) -> Sphere:
        return self.derived(radius=self.radius + distance)
