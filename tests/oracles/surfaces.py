"""Contact surfaces: value, gradient and Hessian of g(p), zero on the surface, and the unit normal.

The gradient points up for z = f(x, y) and outward for closed surfaces, so the normal is
gradient / |gradient|.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from .rotations import bryant

Array = np.ndarray


class Surface(Protocol):
    """A smooth function of a point [m] in {S}; zero where the centre of the ball may be."""

    def value(self, p: Array) -> float: ...
    def gradient(self, p: Array) -> Array: ...
    def hessian(self, p: Array) -> Array: ...


def normal(surface: Surface, p: Array) -> Array:
    """Unit normal, (3,), as in formats.md."""
    gradient = surface.gradient(p)
    return gradient / np.linalg.norm(gradient)


@dataclass(frozen=True)
class Graph:
    """g = z - f(x, y); `jet` gives f, its gradient (2,) and its Hessian (2, 2)."""

    jet: Callable[[Array], tuple[float, Array, Array]]

    def value(self, p: Array) -> float:
        return p[2] - self.jet(p[:2])[0]

    def gradient(self, p: Array) -> Array:
        return np.append(-self.jet(p[:2])[1], 1.0)

    def hessian(self, p: Array) -> Array:
        H = np.zeros((3, 3))
        H[:2, :2] = -self.jet(p[:2])[2]
        return H


@dataclass(frozen=True)
class Quadric:
    """g = scale/2 ((p - centre)' A (p - centre) - 1): sphere, cylinder, ellipsoid."""

    centre: Array
    A: Array
    scale: float  # [m], makes g a distance to first order (exactly so on sphere and cylinder)

    def value(self, p: Array) -> float:
        r = p - self.centre
        return self.scale / 2 * (r @ self.A @ r - 1)

    def gradient(self, p: Array) -> Array:
        return self.scale * self.A @ (p - self.centre)

    def hessian(self, p: Array) -> Array:
        return self.scale * self.A


@dataclass(frozen=True)
class Offset:
    """Points at the signed distance `offset` [m] from a wall, positive along its normal."""

    wall: Surface
    offset: float

    def foot(self, p: Array) -> tuple[Array, float]:
        """Nearest wall point w and signed distance d: p = w + d n(w), g(w) = 0, by Newton."""
        w, d = p.copy(), 0.0
        for _ in range(50):
            n = normal(self.wall, w)
            A = np.block([[np.eye(3) + d * self.turn(w), n[:, None]], [self.wall.gradient(w), 0.0]])
            step = np.linalg.solve(A, np.append(p - w - d * n, -self.wall.value(w)))
            w, d = w + step[:3], d + step[3]
            if np.linalg.norm(step) < 1e-15:
                break
        if not np.linalg.norm(step) < 1e-12:
            raise ValueError("no foot point: the point is too far from the wall")
        return w, d

    def turn(self, w: Array) -> Array:
        """dn/dw on the level set, (3, 3)."""
        gradient = self.wall.gradient(w)
        size = np.linalg.norm(gradient)
        P = np.eye(3) - np.outer(gradient, gradient) / size**2
        return P @ self.wall.hessian(w) @ P / size

    def value(self, p: Array) -> float:
        return self.foot(p)[1] - self.offset

    def gradient(self, p: Array) -> Array:
        return normal(self.wall, self.foot(p)[0])

    def hessian(self, p: Array) -> Array:
        w, d = self.foot(p)
        N = self.turn(w)
        return N @ np.linalg.inv(np.eye(3) + d * N)


@dataclass(frozen=True)
class Held:
    """g = p_axis - at."""

    axis: int
    at: float

    def value(self, p: Array) -> float:
        return p[self.axis] - self.at

    def gradient(self, p: Array) -> Array:
        return np.eye(3)[self.axis]

    def hessian(self, p: Array) -> Array:
        return np.zeros((3, 3))


def _plane(s: dict[str, Any], unit: float) -> Graph:
    slope, offset = np.array(s["slope"], float), s["offset"] * unit
    return Graph(lambda xy: (offset + slope @ xy, slope, np.zeros((2, 2))))


def _quadratic(s: dict[str, Any], unit: float) -> Graph:
    slope, offset = np.array(s.get("slope", [0, 0]), float), s.get("offset", 0.0) * unit
    xx, xy, yy = (s.get(key, 0.0) / unit for key in ("xx", "xy", "yy"))
    H = np.array([[2 * xx, xy], [xy, 2 * yy]])
    return Graph(lambda r: (offset + slope @ r + r @ H @ r / 2, slope + H @ r, H))


def _profile(s: dict[str, Any], unit: float) -> Graph:
    direction = np.array(s["direction"], float)[:2]
    direction /= np.linalg.norm(direction)
    knots, heights = np.array(s["points"], float).T * unit
    spline = CubicSpline(knots, heights, bc_type="natural")

    def jet(xy: Array) -> tuple[float, Array, Array]:
        along = direction @ xy
        inside = np.clip(along, knots[0], knots[-1])
        slope = float(spline(inside, 1))
        curvature = float(spline(inside, 2)) if inside == along else 0.0
        height = float(spline(inside)) + slope * (along - inside)
        return height, slope * direction, curvature * np.outer(direction, direction)

    return Graph(jet)


def _sphere(s: dict[str, Any], unit: float) -> Quadric:
    radius = s["radius"] * unit
    return Quadric(np.array(s["centre"], float) * unit, np.eye(3) / radius**2, radius)


def _cylinder(s: dict[str, Any], unit: float) -> Quadric:
    radius, axis = s["radius"] * unit, np.array(s["axis"], float)
    axis /= np.linalg.norm(axis)
    across = np.eye(3) - np.outer(axis, axis)
    return Quadric(np.array(s["point"], float) * unit, across / radius**2, radius)


def _ellipsoid(s: dict[str, Any], unit: float) -> Quadric:
    axes, R = np.array(s["semi_axes"], float) * unit, bryant(s.get("rotation", [0, 0, 0]))
    centre = np.array(s["centre"], float) * unit
    return Quadric(centre, R @ np.diag(axes**-2) @ R.T, float(np.prod(axes) ** (1 / 3)))


_KINDS: dict[str, Callable[[dict[str, Any], float], Surface]] = {
    "plane": _plane,
    "quadratic": _quadratic,
    "profile": _profile,
    "sphere": _sphere,
    "cylinder": _cylinder,
    "ellipsoid": _ellipsoid,
    "held": lambda s, unit: Held(s["axis"], s["at"] * unit),
}
_SIDES = {"above": 1.0, "outside": 1.0, "below": -1.0, "inside": -1.0}


def read_surface(contact: dict[str, Any], unit: float) -> Surface:
    """Where the ball's centre may be; with `ball_radius` that is off the wall, on `side`."""
    table = contact["surface"]
    wall = _KINDS[table["kind"]](table, unit)
    options = table | contact
    radius = options.get("ball_radius", 0.0) * unit
    return Offset(wall, _SIDES[options["side"]] * radius) if radius else wall
