"""A mandible of few triangles, from the landmarks of a jaw and its condyles: for pictures alone.

One closed shell sweeps a section of eight points from the left ramus round the chin to the right
one, and splits there into coronoid process and condyle; every tooth is a closed box besides. Points
are the landmarks of their side, moved by parts of three lengths: chin to incisor (height of the
body), molar to condyle upwards (of the ramus), and backwards. The proportions are ours, chosen so
that attachments of the bundled jaw's muscles lie on the bone. No mesh of anybody went into it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mechanism import Mechanism
from ...mechanism.ball_joint import joined

SIDES = {"left": 1.0, "right": -1.0}
MIDDLE = ("incisor", "chin")
LANDMARKS = {*MIDDLE, *(f"{s}_{name}" for s in SIDES for name in ("condyle", "canine", "molar"))}
CROWN = 0.27  # height of a crown over that of the body
COLUMNS = np.array([0.0, 0.3, 0.62, 1.0])  # of a section, from its upper or anterior border
# Sections of the body: place along the arch, height, and how far the lower border stands out,
# over the body's height.
BODY = ((0.5, 0.8, 0.0), (1.0, 0.78, 0.02), (1.5, 0.76, 0.1), (2.0, 0.74, 0.16), (2.4, 0.66, 0.2))
# Ends of the crowns of one side along the arch: 0 at the midline, 1 the canine, 2 the first molar;
# depths of a crown at its neck and at its edge, over the body's height.
TEETH = (
    (0.02, 0.36, 0.2, 0.05),
    (0.36, 0.74, 0.2, 0.05),
    (0.74, 1.12, 0.24, 0.07),
    (1.12, 1.45, 0.26, 0.16),
    (1.45, 1.78, 0.28, 0.18),
    (1.78, 2.21, 0.34, 0.26),
    (2.21, 2.58, 0.34, 0.26),
)


@dataclass(frozen=True)
class BodyMesh:
    """A closed surface: vertices (V, 3) [m] in {M}; triangles (F, 3), counter-clockwise seen from
    outside, of which those from `teeth` on are teeth."""

    vertices: np.ndarray
    faces: np.ndarray
    teeth: int | None = None


def jaw_body(mechanism: Mechanism) -> BodyMesh | None:
    """The mandible of a mechanism that has the landmarks of one; else None."""
    jaw = jaw_of(mechanism)
    return None if jaw is None else jaw.body()


def jaw_of(mechanism: Mechanism) -> Jaw | None:
    """The landmarks of a mandible, where a mechanism has them; else None."""
    points = {name: np.array(point) for name, point in mechanism.platform.points.items()}
    points |= {one.name: np.array(one.point) for one in joined(mechanism.contacts)}
    if LANDMARKS - points.keys():
        return None
    jaw = Jaw(points)
    return jaw if jaw.upright else None


@dataclass(frozen=True)
class _Station:
    """A section: its borders, (3,) each, the way outwards, and half its thickness by column."""

    upper: np.ndarray
    lower: np.ndarray
    outwards: np.ndarray
    half: np.ndarray

    def ring(self) -> np.ndarray:
        """Outer columns downwards, then the inner ones upwards, (8, 3)."""
        middle = self.upper + COLUMNS[:, None] * (self.lower - self.upper)
        aside = self.half[:, None] * self.outwards / np.linalg.norm(self.outwards)
        return np.vstack([middle + aside, (middle - aside)[::-1]])


class Jaw:
    """Landmarks, the frame that they span, and what is built on both."""

    def __init__(self, points: dict[str, np.ndarray]) -> None:
        self.incisor, self.chin = points["incisor"], points["chin"]
        self.sides = {
            sign: (points[f"{side}_condyle"], points[f"{side}_canine"], points[f"{side}_molar"])
            for side, sign in SIDES.items()
        }
        left, right = self.sides[1.0], self.sides[-1.0]
        self.y = _unit(left[0] - right[0])
        forward = self.incisor - (left[2] + right[2]) / 2
        self.x = _unit(forward - (forward @ self.y) * self.y)
        self.z = np.cross(self.x, self.y)
        self.body_height = float((self.incisor - self.chin) @ self.z)
        self._arch = self._spline()

    @property
    def upright(self) -> bool:
        """Whether chin, teeth and condyles lie as in a jaw."""
        sizes = [self._lengths(sign) for sign in self.sides]
        return self.body_height > 0 and all(min(lengths) > 0 for lengths in sizes)

    def _lengths(self, sign: float) -> tuple[float, float, float]:
        """Lengths from a side's molar to its condyle: backwards, outwards, upwards [m]."""
        condyle, _, molar = self.sides[sign]
        away = condyle - molar
        return float(-away @ self.x), float(sign * away @ self.y), float(away @ self.z)

    def _spline(self) -> tuple[np.ndarray, Any]:
        """Lengths along the arch of the landmarks on it, and the curve through them."""
        from scipy.interpolate import CubicSpline

        (_, canine_l, molar_l), (_, canine_r, molar_r) = self.sides[1.0], self.sides[-1.0]
        on = np.array([molar_r, canine_r, self.incisor, canine_l, molar_l])
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(on, axis=0), axis=1))])
        return along, CubicSpline(along, on, bc_type="natural")

    def arch(self, place: float) -> tuple[np.ndarray, np.ndarray]:
        """A point of the row of teeth, and the way outwards there; negative: on the right."""
        along, curve = self._arch
        at = np.interp(place, np.arange(-2.0, 3.0), along)
        beyond = (max(abs(place) - 2.0, 0.0)) * np.sign(place) * (along[-1] - along[-2])
        tangent = curve(at, 1)
        tangent = tangent - (tangent @ self.z) * self.z
        return curve(at) + beyond * tangent, np.cross(_unit(tangent), self.z)

    def stations(self, sign: float) -> Iterator[_Station]:
        """Sections of a side, from behind the chin to below the notch of the ramus."""
        b, (a, w, r) = self.body_height, self._lengths(sign)
        condyle, _, molar = self.sides[sign]
        x, out, z = self.x, sign * self.y, self.z
        middle = self.symphysis()
        lean = (middle.upper - middle.lower) @ x
        for place, high, aside in BODY:
            at, outwards = self.arch(sign * place)
            upper = at - CROWN * b * z
            lower = (
                upper - b * (high * z - aside * outwards) - lean * max(1.0 - place / 2.2, 0.0) * x
            )
            yield _Station(upper, lower, outwards, b * np.array([0.13, 0.16, 0.17, 0.1]))
        thin, thick = b * np.array([0.07, 0.14, 0.14, 0.09]), b * np.array([0.1, 0.17, 0.16, 0.1])
        retromolar = molar + a * -0.33 * x + w * 0.33 * out - r * 0.12 * z
        yield _Station(
            retromolar, condyle + a * 0.34 * x - w * 0.34 * out - r * 1.66 * z, out, thick
        )
        front = molar - a * 0.36 * x + w * 0.5 * out + r * 0.14 * z
        yield _Station(front, condyle + a * 0.08 * x - w * 0.24 * out - r * 1.56 * z, out, thin)
        front = molar - a * 0.28 * x + w * 0.56 * out + r * 0.42 * z
        yield _Station(front, condyle - a * 0.06 * x - w * 0.2 * out - r * 0.98 * z, out, thin)
        front = condyle + a * 0.86 * x - w * 0.22 * out - r * 0.3 * z
        yield _Station(front, condyle - a * 0.08 * x - w * 0.12 * out - r * 0.42 * z, out, thin)

    def symphysis(self) -> _Station:
        b = self.body_height
        upper = self.incisor - b * (0.1 * self.x + CROWN * self.z)
        lower = self.chin - b * (0.14 * self.x + 0.06 * self.z)
        return _Station(upper, lower, self.x, b * np.array([0.13, 0.14, 0.2, 0.14]))

    def ends(self, sign: float) -> tuple[np.ndarray, list[np.ndarray]]:
        """Rings of four points, (4, 3): the tip of the coronoid process; neck and head of the
        condyle, upwards. Outer and inner front, then back, as the section's columns run."""
        a, w, r = self._lengths(sign)
        condyle, out = self.sides[sign][0], sign * self.y
        tip = condyle + a * 0.78 * self.x - w * 0.22 * out + r * 0.06 * self.z

        def ring(at: np.ndarray, deep: float, wide: float) -> np.ndarray:
            fore, aside = a * deep * self.x, w * wide * out
            return np.array(
                [at + fore + aside, at - fore + aside, at - fore - aside, at + fore - aside]
            )

        neck = ring(condyle - r * 0.24 * self.z - w * 0.06 * out, 0.08, 0.16)
        low = ring(condyle - r * 0.02 * self.z - w * 0.04 * out, 0.11, 0.42)
        top = ring(condyle + r * 0.13 * self.z - w * 0.04 * out, 0.05, 0.28)
        return ring(tip, 0.05, 0.07), [neck, low, top]

    def body(self) -> BodyMesh:
        left, right = (list(self.stations(sign)) for sign in (1.0, -1.0))
        rings = [s.ring() for s in (*left[::-1], self.symphysis(), *right)]
        vertices, faces = [*rings], list[list[int]]()
        for k in range(len(rings) - 1):
            faces += _tube(8 * k + np.arange(8), 8 * (k + 1) + np.arange(8))
        count = 8 * len(rings)
        for sign, first in ((1.0, 0), (-1.0, 8 * (len(rings) - 1))):
            o, i = first + np.arange(4), first + np.arange(7, 3, -1)  # columns outside and inside
            own = _quad(o[1], o[2], i[2], i[1])  # the notch
            tip, head = self.ends(sign)
            for start, ends in (
                ((o[0], o[1], i[1], i[0]), [tip]),
                ((o[2], o[3], i[3], i[2]), head),
            ):
                ring = np.array(start)
                for end in ends:
                    vertices.append(end)
                    fresh = count + np.arange(4)
                    own += _tube(fresh, ring)
                    ring, count = fresh, count + 4
                own += _quad(*ring)
            faces += own if sign > 0 else [face[::-1] for face in own]
        bone = len(faces)
        for tooth in self.teeth():
            vertices.append(tooth)
            faces += [[count + n for n in face] for face in BOX]
            count += 8
        return BodyMesh(np.vstack(vertices), np.array(faces), bone)

    def teeth(self) -> Iterator[np.ndarray]:
        """Crowns as boxes, (8, 3): the neck's four corners round, then the edge's."""
        b = self.body_height
        for sign in (1.0, -1.0):
            for start, end, neck, edge in TEETH:
                corners = []
                (one, n), (two, m) = self.arch(sign * start), self.arch(sign * end)
                for deep, low in ((neck, CROWN + 0.06), (edge, 0.0)):
                    half, down = b * deep / 2, b * low * self.z
                    row = [one - half * n, two - half * m, two + half * m, one + half * n]
                    corners += [corner - down for corner in row[:: int(sign)]]
                yield np.array(corners)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def _quad(a: Any, b: Any, c: Any, d: Any) -> list[list[int]]:
    return [[a, b, c], [a, c, d]]


def _tube(one: np.ndarray, two: np.ndarray) -> list[list[int]]:
    """The wall between two rings of the same number of points."""
    after = np.roll(np.arange(len(one)), -1)
    return [face for k, m in enumerate(after) for face in _quad(one[k], two[k], two[m], one[m])]


BOX = (
    *_quad(0, 1, 2, 3),
    *_quad(7, 6, 5, 4),
    *(face for k in range(4) for face in _quad(k, 4 + k, 4 + (k + 1) % 4, (k + 1) % 4)),
)
