"""A measured profile: the line of an articular eminence, the same all across."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from ..quantities import Length, Number
from .base import Coordinates, Scalar, SurfaceTable

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

    def constants(self) -> tuple[float, ...]:
        """direction; z and slope before the first knot; for each knot s and what changes there.

        What changes: the coefficients of 1, u, u^2, u^3 in z, with u = s - s_k.
        """
        length = math.hypot(*self.direction)
        s, z = np.array(self.points).T
        pieces = spline_pieces(s, z)
        changes = np.column_stack([s, np.diff(pieces, axis=0)])
        dx, dy = (d / length for d in self.direction)
        return (dx, dy, *map(float, pieces[0, :2]), *map(float, changes.ravel()))


def spline_pieces(s: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Coefficients of 1, u, u^2, u^3 of the natural cubic spline, (n + 1, 4).

    The first piece is the straight line before s[0], with u = s - s[0]; piece k begins at knot
    k - 1, and the last is straight again.
    """
    h, rise = np.diff(s), np.diff(z) / np.diff(s)
    # Equal slopes at the inner knots, f'' = 0 at both ends.
    system = np.eye(len(s))
    right = np.zeros(len(s))
    for k in range(1, len(s) - 1):
        system[k, k - 1 : k + 2] = h[k - 1], 2 * (h[k - 1] + h[k]), h[k]
        right[k] = 6 * (rise[k] - rise[k - 1])
    bend = np.linalg.solve(system, right)  # f'' at the knots
    slope = rise - h * (2 * bend[:-1] + bend[1:]) / 6
    inner = np.column_stack([z[:-1], slope, bend[:-1] / 2, np.diff(bend) / (6 * h)])
    end = rise[-1] + h[-1] * (bend[-2] + 2 * bend[-1]) / 6
    return np.vstack([[z[0], slope[0], 0, 0], inner, [z[-1], end, 0, 0]])
