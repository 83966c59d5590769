"""Closed surfaces of second order, written about one of their own points.

    phi(p) = (p - centre)^T A (p - centre) - level = d^T A d + b . d + e,   d = p - origin.

With an `origin` on the surface no large numbers cancel: a socket of a kilometre's radius is as
exact as its tangent plane, and a small one far from O_M as one at hand.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field

from ..quantities import Angle, Direction, Point, PositiveLength
from .base import Coordinates, Foot, Scalar, SurfaceTable
from .freedom import Freedom, tangents


class Quadric(SurfaceTable):
    """phi of constants as `about_itself` gives them."""

    closed: ClassVar[bool] = True
    by_numpy: ClassVar[bool] = True
    lifted: ClassVar[bool] = False
    carrier: ClassVar[str] = "centre"

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

    @staticmethod
    def from_numbers(f: Any) -> ca.SX:
        """A point of the sphere, its unit normal, phi there, and 1 / (2 radius)."""
        A = ca.SX.eye(3) / (2 * f.radius)
        return about_itself(A, f.centre, f.radius / 2, ca.SX([0, 0, 1]))[:8]

    def joints(self, point: np.ndarray, normal: np.ndarray) -> tuple[Freedom, ...]:
        return tuple(Freedom("hinge", u, np.array(self.centre)) for u in tangents(normal))

    @staticmethod
    def room(f: Any) -> Any:
        return f.radius

    @staticmethod
    def beyond(f: Any, distance: ca.SX) -> Any:
        return SimpleNamespace(centre=f.centre, radius=f.radius + distance)

    @staticmethod
    def nearest(f: Any, point: ca.SX, foot: Foot) -> tuple[ca.SX, ca.SX]:
        lever = point - f.centre
        size = ca.norm_2(lever)
        return size - f.radius, lever / size


class Cylinder(Quadric):
    """A round cylinder without ends: a groove, or a roller.

    |p - axis| = radius, as phi = (|p - axis|^2 - radius^2) / (2 radius).
    """

    kind: Literal["cylinder"] = "cylinder"
    point: Point = Field(description="a point of the axis, in {S}")
    axis: Direction = Field(description="direction of the axis, in {S}")
    radius: PositiveLength

    carrier: ClassVar[str] = "point"

    @staticmethod
    def from_numbers(f: Any) -> ca.SX:
        """The centre is the axis' point nearest O_M."""
        across = _across(f)
        flat = ca.if_else(f.axis[2] ** 2 > f.axis[0] ** 2, ca.SX([1, 0, 0]), ca.SX([0, 0, 1]))
        A = across / (2 * f.radius)
        return about_itself(A, across @ f.point, f.radius / 2, across @ flat)

    def joints(self, point: np.ndarray, normal: np.ndarray) -> tuple[Freedom, ...]:
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        return Freedom("slide", axis, point), Freedom("hinge", axis, np.array(self.point))

    @staticmethod
    def room(f: Any) -> Any:
        return f.radius

    @staticmethod
    def beyond(f: Any, distance: ca.SX) -> Any:
        return SimpleNamespace(point=f.point, axis=f.axis, radius=f.radius + distance)

    @staticmethod
    def nearest(f: Any, point: ca.SX, foot: Foot) -> tuple[ca.SX, ca.SX]:
        lever = _across(f) @ (point - f.point)
        size = ca.norm_2(lever)
        return size - f.radius, lever / size


class Ellipsoid(Quadric):
    """A condyle's own shape, or a shallow socket: (p - centre)^T A (p - centre) = s / 2.

    A = R diag(s / (2 semi_axes^2)) R^T, with R = Rx Ry Rz of `rotation` and s the geometric mean of
    the semi-axes, which makes phi a distance to first order on a sphere.
    """

    kind: Literal["ellipsoid"] = "ellipsoid"
    centre: Point
    semi_axes: tuple[PositiveLength, PositiveLength, PositiveLength]
    rotation: tuple[Angle, Angle, Angle] = Field(
        default=(0.0, 0.0, 0.0),
        description="Bryant angles of the semi-axes: R = Rx Ry Rz maps them to {S}",
    )

    @staticmethod
    def from_numbers(f: Any) -> ca.SX:
        R, h, level = _shape(f)
        return about_itself(R @ ca.diag(h / 2) @ R.T, f.centre, level, R[:, 2])

    @staticmethod
    def principal(f: Any) -> ca.SX:
        """As of `ParallelQuadric`."""
        R, h, _ = _shape(f)
        c = Ellipsoid.from_numbers(f)
        return ca.vertcat(c[:3], ca.vec(R), h, R.T @ c[3:6], c[6])


def _across(f: Any) -> ca.SX:
    """What a cylinder's axis leaves of vectors, (3, 3)."""
    axis = f.axis / ca.norm_2(f.axis)
    return ca.SX.eye(3) - axis @ axis.T


def _shape(f: Any) -> tuple[ca.SX, ca.SX, ca.SX]:
    """R, s / semi_axes^2 (3,) and s / 2 of an ellipsoid."""
    s = (f.semi_axes[0] * f.semi_axes[1] * f.semi_axes[2]) ** (1 / 3)
    (a, b, c), (d, e, g) = (ca.vertsplit(of(f.rotation)) for of in (ca.cos, ca.sin))
    R = ca.vertcat(
        ca.horzcat(b * c, -b * g, e),
        ca.horzcat(a * g + d * e * c, a * c - d * e * g, -d * b),
        ca.horzcat(d * g - a * e * c, d * c + a * e * g, a * b),
    )
    return R, s / f.semi_axes**2, s / 2


def about_itself(A: ca.SX, centre: ca.SX, level: ca.SX, other: ca.SX) -> ca.SX:
    """origin (3), b (3), e, and the entries xx, yy, zz, xy, xz, yz of A.

    The origin is where the line from the centre to O_M meets the surface; where O_M is the centre,
    the one along `other`.
    """
    towards = -centre
    ray = ca.if_else(towards.T @ A @ towards > 1e-12 * level, towards, other)
    origin = centre + ray * ca.sqrt(level / (ray.T @ A @ ray))
    lever = origin - centre
    entries = (A[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return ca.vertcat(origin, 2 * A @ lever, lever.T @ A @ lever - level, *entries)
