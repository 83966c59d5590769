"""The picture of a mechanism in a notebook's cell: rods, platform and contacts at home, as SVG."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from .scene import parts_of, place

AWAY = np.array([1.15, -1.15, 0.6])  # from where one looks, as the page's oblique view
WIDE = 260  # pixels


def mechanism_picture(mechanism: Mechanism) -> str:
    """An SVG in the ink of its cell, light or dark."""
    still = np.zeros((1, 6)), np.zeros((1, len(mechanism.chains)))
    scene = place(mechanism, *still)
    body = parts_of(mechanism, scene).body
    rods = [
        (np.atleast_2d(drawn.points[rod.start])[0], np.atleast_2d(drawn.points[rod.end])[0])
        for drawn in scene.chains.values()
        for rod in drawn.rods
    ]
    balls = [at[0] for at in scene.contacts.values()]
    away = AWAY / np.linalg.norm(AWAY)
    right = np.cross((0.0, 0.0, 1.0), away)
    right /= np.linalg.norm(right)
    look = np.stack([right, -np.cross(away, right)], axis=1)
    points = np.concatenate([np.reshape(rods, (-1, 3)), body.vertices, np.reshape(balls, (-1, 3))])
    flat = points @ look
    low, size = flat.min(axis=0), np.ptp(flat, axis=0)
    scale = WIDE / max(size.max(), 1e-300)
    flat = (flat - low) * scale + 8
    count = 2 * len(rods)
    lines = flat[:count].reshape(-1, 4)
    faces = flat[count : count + len(body.vertices)][np.asarray(body.faces)]
    shapes = [
        f'<polygon points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in face)}" '
        'fill="currentColor" fill-opacity="0.08"/>'
        for face in faces
    ]
    shapes += [
        f'<line x1="{a:.1f}" y1="{b:.1f}" x2="{c:.1f}" y2="{d:.1f}" '
        'stroke="currentColor" stroke-width="2.5" stroke-linecap="round"/>'
        for a, b, c, d in lines
    ]
    shapes += [
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="none" stroke="#c2185b" stroke-width="2"/>'
        for x, y in flat[count + len(body.vertices) :]
    ]
    width, height = size * scale + 16
    return (
        f'<svg role="img" aria-label="chains, platform and contacts at home" '
        f'width="{width:.0f}" height="{height:.0f}">{"".join(shapes)}</svg>'
    )
