"""A second-order surface, as the articular surfaces of the authors' earlier robots."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from ..quantities import Curvature, Length, Number
from .base import Coordinates, Scalar, SurfaceTable


class Quadratic(SurfaceTable):
    """z = offset + slope[0] x + slope[1] y + xx x^2 + xy x y + yy y^2."""

    kind: Literal["quadratic"] = "quadratic"
    offset: Length
    slope: tuple[Number, Number]
    xx: Curvature = Field(default=0.0, description="per length")
    xy: Curvature = Field(default=0.0, description="per length")
    yy: Curvature = Field(default=0.0, description="per length")

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        x, y, z = point[0], point[1], point[2]
        return z - c[0] - (c[1] + c[3] * x + c[4] * y) * x - (c[2] + c[5] * y) * y

    def quadric(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """A, origin, b, e of phi = d^T A d + b . d + e, d = p - origin."""
        A = -np.array([[self.xx, self.xy / 2, 0], [self.xy / 2, self.yy, 0], [0, 0, 0]])
        return A, np.zeros(3), np.array([-self.slope[0], -self.slope[1], 1.0]), -self.offset

    def constants(self) -> tuple[float, ...]:
        return (self.offset, *self.slope, self.xx, self.xy, self.yy)
