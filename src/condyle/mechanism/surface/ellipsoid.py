"""An ellipsoid: a condyle's own shape, or a shallow socket."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ..coordinates import rotations
from ..quantities import Point, PositiveLength, Vector
from .base import Coordinates, Scalar, SurfaceTable
from .parallel import Parallel
from .parallel_quadric import cheapest
from .quadric import about_itself, value


class Ellipsoid(SurfaceTable):
    """(p - centre)^T A (p - centre) = s / 2, as phi = left - right.

    A = R diag(s / (2 semi_axes^2)) R^T, with R = Rx Ry Rz of `rotation` and s the geometric mean of
    the semi-axes, which makes phi a distance to first order on a sphere.
    """

    kind: Literal["ellipsoid"] = "ellipsoid"
    centre: Point
    semi_axes: tuple[PositiveLength, PositiveLength, PositiveLength]
    rotation: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="Bryant angles of the semi-axes [rad]: R = Rx Ry Rz maps them to {S}",
    )

    closed: ClassVar[bool] = True

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        return value(point, self.constants() if constants is None else constants)

    def constants(self) -> tuple[float, ...]:
        """As `quadric.about_itself` gives them."""
        s = math.prod(self.semi_axes) ** (1 / 3)
        R = rotations(np.array(self.rotation))
        A = (R * (s / (2 * np.square(self.semi_axes)))) @ R.T
        return about_itself(A, np.array(self.centre), s / 2)

    def quadric(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """A, origin, b, e of phi = d^T A d + b . d + e, d = p - origin."""
        c = np.array(self.constants())
        A = c[[7, 10, 11, 10, 8, 12, 11, 12, 9]].reshape(3, 3)
        return A, c[:3], c[3:6], float(c[6])

    def parallel(self, distance: float, point: Coordinates) -> Parallel:
        return cheapest(Parallel.near(self, distance, point))
