"""Closed surfaces of second order, written about one of their own points.

    phi(p) = (p - centre)^T A (p - centre) - level = d^T A d + b . d + e,   d = p - origin.

With an `origin` on the surface no large numbers cancel: a socket of a kilometre's radius is as
exact as its tangent plane, and a small one far from O_M as one at hand.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ..coordinates import rotations
from ..quantities import Direction, Point, PositiveLength, Vector
from .base import Coordinates, Scalar, SurfaceTable


class Quadric(SurfaceTable):
    """phi of constants as `about_itself` gives them."""

    closed: ClassVar[bool] = True

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
        i = c[7] * x + c[10] * y + c[11] * z + c[3]
        j = c[10] * x + c[8] * y + c[12] * z + c[4]
        k = c[11] * x + c[12] * y + c[9] * z + c[5]
        return x * i + y * j + z * k + c[6]


class Sphere(Quadric):
    """A ball joint's socket, or a dome: phi = (|p - centre|^2 - radius^2) / (2 radius).

    No square root: on the surface the gradient is the unit normal, and its derivative constant.
    """

    kind: Literal["sphere"] = "sphere"
    centre: Point
    radius: PositiveLength

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
        return x * (c[7] * x + c[3]) + y * (c[7] * y + c[4]) + z * (c[7] * z + c[5]) + c[6]

    def constants(self) -> tuple[float, ...]:
        """A point of the sphere, its unit normal, phi there, and 1 / (2 radius)."""
        A = np.eye(3) / (2 * self.radius)
        return about_itself(A, np.array(self.centre), self.radius / 2)[:8]

    def at_distance(self, distance: float) -> Sphere:
        return self.derived(radius=self.radius + distance)


class Cylinder(Quadric):
    """A round cylinder without ends: a groove, or a roller.

    |p - axis| = radius, as phi = (|p - axis|^2 - radius^2) / (2 radius).
    """

    kind: Literal["cylinder"] = "cylinder"
    point: Point = Field(description="a point of the axis, in {S}")
    axis: Direction = Field(description="direction of the axis, in {S}")
    radius: PositiveLength

    def constants(self) -> tuple[float, ...]:
        """The centre is the axis' point nearest O_M."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        across = np.eye(3) - np.outer(axis, axis)
        return about_itself(across / (2 * self.radius), across @ self.point, self.radius / 2)

    def at_distance(self, distance: float) -> Cylinder:
        return self.derived(radius=self.radius + distance)


class Ellipsoid(Quadric):
    """A condyle's own shape, or a shallow socket: (p - centre)^T A (p - centre) = s / 2.

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

    def constants(self) -> tuple[float, ...]:
        s = math.prod(self.semi_axes) ** (1 / 3)
        R = rotations(np.array(self.rotation))
        A = (R * (s / (2 * np.square(self.semi_axes)))) @ R.T
        return about_itself(A, np.array(self.centre), s / 2)

    def quadric(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """A, origin, b, e of phi = d^T A d + b . d + e, d = p - origin."""
        c = np.array(self.constants())
        A = c[[7, 10, 11, 10, 8, 12, 11, 12, 9]].reshape(3, 3)
        return A, c[:3], c[3:6], float(c[6])


def about_itself(A: np.ndarray, centre: np.ndarray, level: float) -> tuple[float, ...]:
    """origin (3), b (3), e, and the entries xx, yy, zz, xy, xz, yz of A.

    The origin is where the line from the centre to O_M meets the surface.
    """
    ray = -centre
    if not ray @ A @ ray > 1e-12 * level:
        ray = np.linalg.eigh(A)[1][:, -1]
    origin = centre + ray * np.sqrt(level / (ray @ A @ ray))
    lever = origin - centre
    entries = (A[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return tuple(map(float, (*origin, *(2 * A @ lever), lever @ A @ lever - level, *entries)))
