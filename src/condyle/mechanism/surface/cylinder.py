"""A round cylinder without ends: a groove, or a roller."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ..quantities import Direction, Point, PositiveLength
from .base import Coordinates, Scalar, SurfaceTable
from .quadric import about_itself, value


class Cylinder(SurfaceTable):
    """|p - axis| = radius, as phi = (|p - axis|^2 - radius^2) / (2 radius)."""

    kind: Literal["cylinder"] = "cylinder"
    point: Point = Field(description="a point of the axis, in {S}")
    axis: Direction = Field(description="direction of the axis, in {S}")
    radius: PositiveLength

    closed: ClassVar[bool] = True

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        return value(point, self.constants() if constants is None else constants)

    def constants(self) -> tuple[float, ...]:
        """As `quadric.about_itself` gives them, the centre being the axis' point nearest O_M."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        across = np.eye(3) - np.outer(axis, axis)
        return about_itself(across / (2 * self.radius), across @ self.point, self.radius / 2)

    def parallel(self, distance: float, point: Coordinates) -> Cylinder:
        return self.derived(radius=self.radius + distance)
