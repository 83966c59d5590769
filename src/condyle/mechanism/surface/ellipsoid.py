"""An ellipsoid: a condyle's own shape, or a shallow socket."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ..quantities import Number, Point, PositiveLength, Vector
from .base import Coordinates, Scalar, SurfaceTable


class Ellipsoid(SurfaceTable):
    """(p - centre)^T A (p - centre) = s, as phi = (left - s) / 2.

    A = s R diag(1 / semi_axes^2) R^T, with R = Rx Ry Rz of `rotation` and s the geometric mean of
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
        c = self.constants() if constants is None else constants
        x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
        i = c[3] * x + c[6] * y + c[7] * z
        j = c[6] * x + c[4] * y + c[8] * z
        k = c[7] * x + c[8] * y + c[5] * z
        return (x * i + y * j + z * k - c[9]) / 2

    def constants(self) -> tuple[float, ...]:
        """centre, entries xx, yy, zz, xy, xz, yz of A, and s."""
        s = math.prod(self.semi_axes) ** (1 / 3)
        R = bryant_matrix(self.rotation)
        A = (R * (s / np.square(self.semi_axes))) @ R.T
        entries = (A[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        return (*self.centre, *map(float, entries), s)


def bryant_matrix(angles: tuple[Number, Number, Number]) -> np.ndarray:
    """R = Rx(alpha) Ry(beta) Rz(gamma), (3, 3)."""
    (ca, sa), (cb, sb), (cg, sg) = ((math.cos(a), math.sin(a)) for a in angles)
    Rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    Ry = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    Rz = np.array([[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]])
    return Rx @ Ry @ Rz
