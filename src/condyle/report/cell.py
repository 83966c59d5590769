"""The picture of a mechanism at home as SVG: in a notebook's cell, or a file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from html import escape
from itertools import groupby
from textwrap import wrap

import numpy as np

from ..files.atomic import check_writable, write_text
from ..kinematics.free_motion import FreeMotion
from ..mechanism import Mechanism
from .scene import VIEWS, Camera, Scene, SceneParts, cloud, faces_of, parts_of, place
from .scene.still import Arrow

WIDE = 260  # pixels
LINE, LETTER = 16, 7  # height and width of the caption's letters [pixels]
AXIS = 0.7  # of a free motion: half its axis over the diagonal of everything,
FASTEST = 0.25  # and the longest arrow at a joint


def mechanism_picture(
    mechanism: Mechanism, free: FreeMotion | None = None, caption: str = "", wide: int = WIDE
) -> str:
    """An SVG that stands on a light and on a dark ground.

    Args: free: motion at home, drawn by its axis and by arrows at the platform's joints;
          wide: longest side [pixels].
    """
    scene = place(mechanism, np.zeros((1, 6)), np.zeros((1, len(mechanism.chains))))
    parts = parts_of(mechanism, scene)
    arrows = [] if free is None else list(_arrows(mechanism, scene, parts, free))
    faces = faces_of(parts, scene, arrows=arrows)
    flat, colours = faces.seen(Camera.of(*VIEWS[parts.view]))
    flat = flat * [1, -1]
    low, size = flat.min(axis=(0, 1)), np.ptp(flat.reshape(-1, 2), axis=0)
    scale = wide / max(size.max(), 1e-300)
    width, height = size * scale + 4
    corners = np.round(10 * ((flat - low) * scale + 2)).astype(int)
    # Coordinates are tenths of a pixel; neighbours of one colour are one path.
    shapes = [
        f'<path {look} d="{"".join(_triangle(corners[k]) for k, _ in run)}"/>'
        for look, run in groupby(enumerate(map(_look, colours)), key=lambda one: one[1])
    ]
    lines = wrap(caption, wide // LETTER)
    width, below = (wide + 4, height) if lines else (width, height)
    height += (len(lines) + bool(lines)) * LINE
    shapes += [
        f'<text x="20" y="{10 * (below + (k + 1) * LINE):.0f}" fill="#808080" font-size="130" '
        f'font-family="sans-serif">{escape(line)}</text>'
        for k, line in enumerate(lines)
    ]
    return (
        f'<svg role="img" aria-label="the mechanism at home" width="{width:.0f}" '
        f'height="{height:.0f}" viewBox="0 0 {10 * width:.0f} {10 * height:.0f}">'
        f'<g stroke-width="2">{"".join(shapes)}</g></svg>'
    )


def write_picture(
    path: str | os.PathLike[str], mechanism: Mechanism, free: FreeMotion | None, caption: str
) -> None:
    """`mechanism_picture` as a file (.svg)."""
    check_writable(path, (".svg",))
    picture = mechanism_picture(mechanism, free, caption, 2 * WIDE)
    write_text(path, picture.replace("<svg", '<svg xmlns="http://www.w3.org/2000/svg"', 1))


def _arrows(
    mechanism: Mechanism, scene: Scene, parts: SceneParts, free: FreeMotion
) -> Iterator[Arrow]:
    """The axis, and the velocities of the platform's joints and contact points, at home."""
    everything = cloud(scene, parts.body.vertices)
    size = float(np.linalg.norm(np.ptp(everything, axis=0)))
    if free.turns:
        point, along = free.axis
        point = point + ((everything.mean(axis=0) - point) @ along) * along
        reach = AXIS * size * along
        yield point - reach, point + reach, "ball"
    points = np.array(
        [one.platform for one in mechanism.chains] + [one.point for one in mechanism.contacts]
    )
    velocity = free.V + np.cross(free.omega, points)
    fastest = np.linalg.norm(velocity, axis=1).max()
    for at, arrow in zip(points, FASTEST * size * velocity / (fastest or 1.0), strict=True):
        yield at, at + arrow, "ink"


def _look(colour: np.ndarray) -> str:
    tint = "#" + "".join(f"{round(255 * value):02x}" for value in colour[:3])
    thin = "" if colour[3] == 1.0 else f' opacity="{colour[3]:g}"'
    return f'fill="{tint}" stroke="{tint}"{thin}'


def _triangle(corners: np.ndarray) -> str:
    (x, y), *others = corners
    steps = np.diff(np.vstack([[x, y], *others]), axis=0)
    return f"M{x} {y}" + "".join(f"l{dx} {dy}" for dx, dy in steps) + "z"
