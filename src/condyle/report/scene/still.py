"""A still of a mechanism: shaded triangles of its solids, the furthest first.

Figures, films and the picture in a notebook's cell draw these, each with its own means.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from .arrows import SHAFT, TINTS, Force
from .colours import DARK, LIGHT, ROLES
from .muscles import activation_colour
from .parts import SceneParts
from .place import Scene
from .solids import arrow

SHADE = 0.6  # brightness of a face that looks away from the light
STEPS = 12  # of brightness, so that neighbours are of one colour
Arrow = tuple[np.ndarray, np.ndarray, str]  # tail and head in {S}, (3,) [m] each, and a role
GROUPS = ("platform", "balls", "chains", "joints", "surfaces")


def rgb(colour: str) -> tuple[int, int, int]:
    """'#rrggbb' as numbers from 0 to 255."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


def tint_of(colour: str | int, dark: bool = False) -> str:
    """'#rrggbb' of a `Solid`'s colour; of a muscle at rest, if activation decides."""
    if isinstance(colour, int):
        return (DARK if dark else LIGHT)[colour]
    return activation_colour(0.0, dark) if colour == "activation" else ROLES[colour][dark]


@dataclass(frozen=True)
class Camera:
    """Unit vectors in {S}: to the right, upwards and towards who looks."""

    right: np.ndarray
    up: np.ndarray
    away: np.ndarray

    @classmethod
    def of(cls, away: Sequence[float], up: Sequence[float]) -> Camera:
        """The camera from where one looks, and what is up, as in `VIEWS`."""
        back = np.asarray(away, dtype=float) / np.linalg.norm(away)
        right = np.cross(up, back)
        right /= np.linalg.norm(right)
        return cls(right, np.cross(back, right), back)

    def flat(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) in the picture's plane, (..., 2) [m]."""
        seen: np.ndarray = points @ np.stack([self.right, self.up], axis=1)
        return seen


@dataclass(frozen=True)
class Faces:
    """Triangles in {S}: corners (F, 3, 3) [m], and red, green, blue and opacity (F, 4), 0 to 1."""

    corners: np.ndarray
    colours: np.ndarray

    def seen(self, camera: Camera) -> tuple[Any, np.ndarray]:
        """Triangles (F, 3, 2) [m] that look at the camera, the furthest first, as they are lit."""
        corners, colours = self.corners, self.colours
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        with np.errstate(invalid="ignore", divide="ignore"):
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        visible = np.flatnonzero(np.isfinite(normal).all(axis=1) & (normal @ camera.away > 0))
        order = visible[np.argsort((corners[visible] @ camera.away).mean(axis=1), kind="stable")]
        light = camera.away + 0.7 * camera.up + 0.3 * camera.right
        lit = np.clip(normal[order] @ (light / np.linalg.norm(light)), 0.0, 1.0)
        shaded = colours[order]
        shaded[:, :3] *= (SHADE + (1 - SHADE) * np.round(STEPS * lit) / STEPS)[:, None]
        return camera.flat(corners[order]), shaded


def faces_of(
    parts: SceneParts,
    scene: Scene,
    sample: int = 0,
    forces: Sequence[tuple[Force, float]] = (),
    activation: Mapping[str, float] = MappingProxyType({}),
    arrows: Sequence[Arrow] = (),
) -> Faces:
    """The solids and arrows of a sample.

    Args: forces: to draw, with metres a newton;  activation: by muscle, 0 to 1 and beyond;
          arrows: others, fixed in {S}.
    """
    corners: list[np.ndarray] = []
    colours: list[np.ndarray] = []

    def add(triangles: np.ndarray, tint: str, opacity: float = 1.0) -> None:
        corners.append(triangles)
        colours.append(np.tile([*np.divide(rgb(tint), 255), opacity], (len(triangles), 1)))

    for solid in parts.of_group(*GROUPS):
        triangles = solid.at(scene, sample)[solid.faces]
        tint = tint_of(solid.colour)
        if solid.colour == "activation":
            tint = activation_colour(activation.get(solid.owner, 0.0))
        add(triangles, tint, solid.opacity)
        if solid.group == "surfaces":  # both sides of a sheet
            add(triangles[:, ::-1], tint, solid.opacity)
    pushes = [(*force.ends(scene, scale), TINTS[force.kind]) for force, scale in forces]
    for tail, head, colour in [*((t[sample], h[sample], c) for t, h, c in pushes), *arrows]:
        if np.isfinite(tail).all() and not np.array_equal(tail, head):
            vertices, faces = arrow(tail, head, SHAFT * parts.size)
            add(vertices[faces], tint_of(colour))
    return Faces(np.concatenate(corners), np.concatenate(colours))
