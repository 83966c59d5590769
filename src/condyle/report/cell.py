"""The picture of a mechanism in a notebook's cell: its scene at home, as SVG."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from ..mechanism import Mechanism
from .scene import VIEWS, Camera, faces_of, parts_of, place

WIDE = 260  # pixels


def mechanism_picture(mechanism: Mechanism) -> str:
    """An SVG that stands on a light and on a dark ground."""
    scene = place(mechanism, np.zeros((1, 6)), np.zeros((1, len(mechanism.chains))))
    parts = parts_of(mechanism, scene)
    flat, colours = faces_of(parts, scene).seen(Camera.of(*VIEWS[parts.view]))
    flat = flat * [1, -1]
    low, size = flat.min(axis=(0, 1)), np.ptp(flat.reshape(-1, 2), axis=0)
    scale = WIDE / max(size.max(), 1e-300)
    width, height = size * scale + 4
    corners = np.round(10 * ((flat - low) * scale + 2)).astype(int)
    # Coordinates are tenths of a pixel; neighbours of one colour are one path.
    shapes = [
        f'<path {look} d="{"".join(_triangle(corners[k]) for k, _ in run)}"/>'
        for look, run in groupby(enumerate(map(_look, colours)), key=lambda one: one[1])
    ]
    return (
        f'<svg role="img" aria-label="the mechanism at home" width="{width:.0f}" '
        f'height="{height:.0f}" viewBox="0 0 {10 * width:.0f} {10 * height:.0f}">'
        f'<g stroke-width="2">{"".join(shapes)}</g></svg>'
    )


def _look(colour: np.ndarray) -> str:
    tint = "#" + "".join(f"{round(255 * value):02x}" for value in colour[:3])
    thin = "" if colour[3] == 1.0 else f' opacity="{colour[3]:g}"'
    return f'fill="{tint}" stroke="{tint}"{thin}'


def _triangle(corners: np.ndarray) -> str:
    (x, y), *others = corners
    steps = np.diff(np.vstack([[x, y], *others]), axis=0)
    return f"M{x} {y}" + "".join(f"l{dx} {dy}" for dx, dy in steps) + "z"
