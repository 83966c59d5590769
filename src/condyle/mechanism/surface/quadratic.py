"""A second-order surface, as the articular surfaces of the authors' earlier robots."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field

from ..quantities import Curvature, Length, Number
from .base import Coordinates, Scalar, SurfaceTable
from .freedom import principal_directions


class Quadratic(SurfaceTable):
    """z = offset + slope[0] x + slope[1] y + xx x^2 + xy x y + yy y^2."""

    kind: Literal["quadratic"] = "quadratic"
    offset: Length
    slope: tuple[Number, Number]
    xx: Curvature = Field(default=0.0, description="per length")
    xy: Curvature = Field(default=0.0, description="per length")
    yy: Curvature = Field(default=0.0, description="per length")

    by_numpy: ClassVar[bool] = True

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        x, y, z = point[0], point[1], point[2]
        return z - c[0] - (c[1] + c[3] * x + c[4] * y) * x - (c[2] + c[5] * y) * y

    @staticmethod
    def from_numbers(f: Any) -> ca.SX:
        return ca.vertcat(f.offset, f.slope, f.xx, f.xy, f.yy)

    @property
    def curved_alike(self) -> bool:
        return self.xx == self.yy and self.xy == 0

    def level_directions(self) -> np.ndarray:
        return principal_directions(-np.array([[2 * self.xx, self.xy], [self.xy, 2 * self.yy]]))

    @staticmethod
    def principal(f: Any) -> ca.SX:
        """As of `ParallelQuadric`; the first axis is the one nearest X.

        Where the surface is equally curved all round, the axes have no derivative.
        """
        across, twist = f.xx - f.yy, f.xy
        size = ca.sqrt(across**2 + twist**2)
        none = ca.logic_not(size)
        size += none
        side = 1 - 2 * (across < 0)
        cosine = ca.sqrt((1 + (ca.fabs(across) + none) / size) / 2)
        sine = side * twist / size / (2 * cosine)
        turn = ca.SX.eye(3)
        turn[:2, :2] = ca.vertcat(ca.horzcat(cosine, -sine), ca.horzcat(sine, cosine))
        bend = ca.SX.zeros(3, 3)
        bend[0, 0], bend[1, 1], bend[0, 1] = 2 * f.xx, 2 * f.yy, f.xy
        bend[1, 0] = f.xy
        h = -ca.vertcat(*(turn[:, i].T @ bend @ turn[:, i] for i in (0, 1)), 0)
        b = turn.T @ ca.vertcat(-f.slope, 1)
        return ca.vertcat(ca.SX.zeros(3), ca.vec(turn), h, b, -f.offset)
