"""The solids of a picture in space, each described once: its mesh, its colour, and how it moves.

Every picture places the same solids: the page (`geometry.js`), the live page (`view/stage.py`) and
the stills of figures, films and cells (`still.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .place import Scene

RINGS = 12  # points round a rod; a ball has half as many rows
COARSE = 8  # of a small ball
HEAD = 5.0  # length of an arrow's head over the radius of its shaft, and at most
HEAD_PART = 0.5  # of the arrow;
HEAD_WIDE = 2.4  # radius of the head over that of the shaft
# How much of the light a body stops, where it is not all.
OPACITY = {"platform": 0.5, "surface": 0.55}

Motion = Literal["fixed", "platform", "point", "line"]
# Vertices (V, 3), and faces (F, 3), counter-clockwise seen from outside.
Mesh = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Solid:
    """A mesh of one colour.

    group: "platform", "chains", "joints", "balls", "landmarks" or "surfaces".
    owner: the chain, contact or landmark that it shows.
    vertices, faces: of its `Mesh`, [m]; by `motion` in {S} ("fixed"), in {M} ("platform"), from a
        point of the chain ("point"), or swept along a line through such points ("line"): x and y
        are across the line, z runs along it, from 0 at the first point by 1 a point.
    colour: a role of `ROLES`, a number of the palette, or "activation".
    points: of the chain, by name, for "point" and "line".
    """

    group: str
    owner: str
    vertices: np.ndarray
    faces: np.ndarray
    colour: str | int
    motion: Motion = "fixed"
    points: tuple[str, ...] = ()

    @property
    def opacity(self) -> float:
        return OPACITY.get(str(self.colour), 1.0)

    def at(self, scene: Scene, sample: int = 0) -> np.ndarray:
        """Its vertices in {S} at a sample of a scene, (V, 3) [m]."""
        if self.motion == "fixed":
            return self.vertices
        position = scene.position[sample]
        if self.motion == "platform":
            return position + self.vertices @ scene.rotation[sample].T
        line = scene.line(self.owner, self.points, sample)
        return line[0] + self.vertices if len(line) == 1 else swept(line, self.vertices, position)


def swept(line: np.ndarray, vertices: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Vertices of a `Solid` along a line, (m, 3) [m]; y is away from a point `inside`, (3,)."""
    k = np.clip(vertices[:, 2].astype(int), 0, len(line) - 2)
    middle = line[k] + (vertices[:, 2] - k)[:, None] * (line[k + 1] - line[k])
    wide, thin = across(line, inside)
    placed: np.ndarray = middle + vertices[:, :1] * wide + vertices[:, 1:2] * thin
    return placed


def across(line: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Two unit vectors across the chord of a line, (2, 3); the second is away from `inside`."""
    chord = line[-1] - line[0]
    chord = chord / (np.linalg.norm(chord) or 1.0)
    thin = line[[0, -1]].mean(axis=0) - inside
    thin = thin - (thin @ chord) * chord
    size = float(np.linalg.norm(thin))
    if not size > 1e-9:  # the line goes through the point
        thin = np.cross(chord, np.eye(3)[np.argmin(np.abs(chord))])
        size = float(np.linalg.norm(thin)) or 1.0
    thin = thin / size
    return np.stack([np.cross(thin, chord), thin])


def tube(radius: ArrayLike, z: ArrayLike, flat: float = 1.0, sides: int = RINGS) -> Mesh:
    """A closed tube round Z, of elliptic rings at heights `z`; flat: their y over their x."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), flat * np.sin(angle)])
    across_ = np.asarray(radius, dtype=float)[:, None, None] * ring
    height = np.broadcast_to(np.asarray(z, dtype=float)[:, None, None], (*across_.shape[:2], 1))
    vertices = np.concatenate([across_, height], axis=2).reshape(-1, 3)
    k, m = np.arange(sides), np.roll(np.arange(sides), -1)
    faces = []
    for start in sides * np.arange(len(across_) - 1):
        a, b, c, d = start + k, start + m, start + sides + m, start + sides + k
        faces += [np.column_stack([a, b, c]), np.column_stack([a, c, d])]
    fan, end = np.arange(1, sides - 1), sides * (len(across_) - 1)
    faces.append(np.column_stack([0 * fan, fan + 1, fan]))
    faces.append(np.column_stack([end + 0 * fan, end + fan, end + fan + 1]))
    return vertices, np.concatenate(faces)


def ball(radius: float, sides: int = RINGS) -> Mesh:
    """A ball round the origin."""
    polar = np.linspace(np.pi, 0.0, sides // 2 + 1)
    vertices, faces = tube(radius * np.sin(polar), radius * np.cos(polar), sides=sides)
    corners = vertices[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return vertices, faces[area > 1e-9 * area.max()]  # at the poles rings are points


# An arrow along Z from 0 to 1 in two pieces, whose radius is that of the shaft.
SHAFT, ARROWHEAD = tube([1.0, 1.0], [0.0, 1.0]), tube([HEAD_WIDE, 0.0], [0.0, 1.0])


def arrow(start: np.ndarray, end: np.ndarray, radius: float) -> Mesh:
    """An arrow between two points, (3,) [m]; a short one is thin."""
    size = float(np.linalg.norm(end - start))
    radius *= min(1.0, size / (HEAD * radius))
    neck = end - (end - start) * min(HEAD * radius / (size or 1.0), HEAD_PART)
    thick = np.array([radius, radius, 1.0])
    far = start - np.eye(3)[np.argmin(np.abs(end - start))]  # a point off the arrow's line
    vertices = [
        swept(np.stack(line), thick * piece, far)
        for line, piece in (((start, neck), SHAFT[0]), ((neck, end), ARROWHEAD[0]))
    ]
    return np.vstack(vertices), np.vstack([SHAFT[1], len(vertices[0]) + ARROWHEAD[1]])
