"""A measured profile: the line of an articular eminence, the same all across."""

from __future__ import annotations

import math
from itertools import accumulate, pairwise
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import AfterValidator, Field

from ..quantities import Length, Number
from .base import Coordinates, Scalar, SurfaceTable

FADES = 0.4  # what is left of a bend at the next knot, at most
UNIT = 1e-6  # how far the length of `direction` may be from 1


def _horizontal(value: tuple[float, ...]) -> tuple[float, ...]:
    if any(value[2:]):
        raise ValueError(f"a direction in the X-Y plane has no z, got {list(value)}")
    if abs(math.hypot(*value) - 1.0) > UNIT:
        raise ValueError(
            f"expected a unit vector, got {list(value)} of length {math.hypot(*value):.7g}"
        )
    return value[:2]


def _rising(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    for k, ((before, _), (after, _)) in enumerate(pairwise(points), 2):
        if not before < after:
            raise ValueError(f"s must rise from point to point; point {k} is not beyond the last")
    return points


class Profile(SurfaceTable):
    """z = f(s), s = direction . (x, y): the natural cubic spline through
    `points`, extended straight.

    f is one cubic between knots, chosen by comparisons s >= s_k. Those have no derivative and
    pick exactly one piece, so that f, f' and f'' are exact, at the knots too.
    """

    kind: Literal["profile"] = "profile"
    direction: Annotated[
        tuple[Number, ...], Field(min_length=2, max_length=3), AfterValidator(_horizontal)
    ] = Field(description="unit vector in the X-Y plane along which s is measured")
    points: Annotated[
        tuple[tuple[Length, Length], ...],
        Field(min_length=3, max_length=1000),
        AfterValidator(_rising),
    ] = Field(description="[[s, z], ...] with rising s")

    by_numpy: ClassVar[bool] = True
    carrier: ClassVar[str] = "points"

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        s = c[0] * point[0] + c[1] * point[1]
        knot, z, slope, second, third = c[4], c[2], c[3], 0.0, 0.0  # straight, before the first
        last = knot
        for k in range(4, c.numel() if hasattr(c, "numel") else len(c), 5):
            beyond = s >= c[k]
            knot = knot + beyond * (c[k] - last)
            z, slope = z + beyond * c[k + 1], slope + beyond * c[k + 2]
            second, third = second + beyond * c[k + 3], third + beyond * c[k + 4]
            last = c[k]
        u = s - knot
        return point[2] - z - u * (slope + u * (second + u * third))

    @classmethod
    def moved(cls, f: Any, by: Any, normal: Any) -> Any:
        lift = ca.repmat(ca.vertcat(0, by), f.points.numel() // 2)
        return SimpleNamespace(direction=f.direction, points=f.points + lift)

    def level_directions(self) -> np.ndarray:
        d = np.array(self.direction[:2]) / np.linalg.norm(self.direction[:2])
        return np.array([d, [-d[1], d[0]]])

    def bends(self, constants: Any) -> tuple[float, float]:
        """f'' is straight between knots, and 0 before the first."""
        bend = [0.0, *accumulate(2 * change for change in constants[7::5])]
        return -max(bend), -min(bend)

    def rounded(self, point: ca.SX, constants: Any) -> ca.SX:
        """Heights round, and second differences of close knots magnify that; from knot to knot
        less than half of it is left.
        """
        c = ca.vertsplit(constants)
        knots, heights = c[4::5], accumulate([c[2] + c[5], *c[10::5]])
        steps = [after - before for before, after in pairwise(knots)]
        steps = [steps[0], *steps, steps[-1]]
        off = [
            ca.fabs(z) / ca.fmin(*near) ** 2
            for z, near in zip(heights, pairwise(steps), strict=True)
        ]
        for _ in range(2):  # up, and down again
            off = list(accumulate(off, lambda last, own: ca.fmax(own, FADES * last)))[::-1]
        s = c[0] * point[0] + c[1] * point[1]
        found = last = off[0]
        for knot, own in zip(knots, off, strict=True):
            found, last = found + (s >= knot) * (own - last), own
        return found

    @staticmethod
    def sound(f: Any) -> list[ca.SX]:
        s, off = f.points[0::2], ca.norm_2(f.direction) - 1
        return [ca.fabs(off) <= UNIT, *ca.vertsplit(s[1:] > s[:-1])]

    @staticmethod
    def from_numbers(f: Any) -> ca.SX:
        """direction; z and slope before the first knot; for each knot s and what changes there.

        What changes: the coefficients of 1, u, u^2, u^3 in z, with u = s - s_k.
        """
        s, z = f.points[0::2], f.points[1::2]
        pieces = spline_pieces(s, z)
        changes = ca.horzcat(s, pieces[1:, :] - pieces[:-1, :])
        return ca.vertcat(f.direction / ca.norm_2(f.direction), pieces[0, :2].T, ca.vec(changes.T))


def spline_pieces(s: ca.SX, z: ca.SX) -> ca.SX:
    """Coefficients of 1, u, u^2, u^3 of the natural cubic spline, (n + 1, 4).

    The first piece is the straight line before s[0], with u = s - s[0]; piece k begins at knot
    k - 1, and the last is straight again.
    """
    h = s[1:] - s[:-1]
    rise = (z[1:] - z[:-1]) / h
    bend = _bends(h, rise)
    slope = rise - h * (2 * bend[:-1] + bend[1:]) / 6
    inner = ca.horzcat(z[:-1], slope, bend[:-1] / 2, (bend[1:] - bend[:-1]) / (6 * h))
    end = rise[-1] + h[-1] * (bend[-2] + 2 * bend[-1]) / 6
    return ca.vertcat(ca.horzcat(z[0], slope[0], 0, 0), inner, ca.horzcat(z[-1], end, 0, 0))


def _bends(h: ca.SX, rise: ca.SX) -> ca.SX:
    """f'' at the knots: equal slopes at the inner ones, 0 at both ends.

    h[k-1] f''[k-1] + 2 (h[k-1] + h[k]) f''[k] + h[k] f''[k+1] = 6 (rise[k] - rise[k-1]).
    """
    count = h.numel()
    above, right = [ca.SX(0)], [ca.SX(0)]
    for k in range(1, count):
        pivot = 2 * (h[k - 1] + h[k]) - h[k - 1] * above[-1]
        right.append((6 * (rise[k] - rise[k - 1]) - h[k - 1] * right[-1]) / pivot)
        above.append(h[k] / pivot)
    bend = [ca.SX(0)]
    for k in range(count - 1, 0, -1):
        bend.append(right[k] - above[k] * bend[-1])
    return ca.vertcat(0, *reversed(bend))
