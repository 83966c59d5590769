"""What a picture in space draws of a mechanism, and how large; page and live page only move it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...mechanism import Contact, Mechanism
from .colours import styles
from .hull import platform_hull
from .patches import Patch, contact_patch
from .place import Scene

SIZE = 0.26  # the size that all others are stated in, over the diagonal of everything
ROD, JOINT, BALL = 0.022, 0.042, 0.08  # radii, where the file gives none
# Where cameras stand, what is up, and whether there is no perspective, as on an engineer's sheet.
VIEWS = {
    "Front": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), True),
    "Side": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0), True),
    "Top": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), True),
    "Oblique": ((1.15, -1.15, 0.6), (0.0, 0.0, 1.0), False),
}


@dataclass(frozen=True)
class Bar:
    """A straight body between two points of its chain; colour: of the palette, None: neutral."""

    chain: str
    body: str
    start: str
    end: str
    radius: float
    colour: int | None


@dataclass(frozen=True)
class Parts:
    """The solids of a mechanism [m].

    hull: the platform's vertices, (V, 3) in {M}, and faces.   joints: (chain, point) each.
    balls: radius by contact.   surfaces: by contact, of those whose equation is known.
    """

    size: float
    hull: tuple[np.ndarray, np.ndarray]
    bars: list[Bar]
    joints: list[tuple[str, str]]
    balls: dict[str, float]
    surfaces: dict[str, Patch]


def cloud(scene: Scene, hull: np.ndarray) -> np.ndarray:
    """Every place that a point of the mechanism is ever at, (P, 3) [m]."""
    clouds = [p.reshape(-1, 3) for d in scene.chains.values() for p in d.points.values()]
    step = max(len(scene.position) // 200, 1)
    corners = scene.position[::step, None] + np.einsum("nij,vj->nvi", scene.rotation[::step], hull)
    return np.vstack([*clouds, corners.reshape(-1, 3), *scene.contacts.values(), hull])


def parts_of(mechanism: Mechanism, scene: Scene) -> Parts:
    """The solids, as large as the mechanism is at the poses of a scene."""
    hull = platform_hull(mechanism)
    points = cloud(scene, hull[0])
    size = SIZE * float(np.linalg.norm(np.nanmax(points, axis=0) - np.nanmin(points, axis=0)))
    looks = dict(zip(mechanism.chain_names, styles(mechanism.chain_names), strict=True))
    bars = [
        Bar(
            chain,
            rod.body,
            rod.start,
            rod.end,
            ROD * size * rod.thickness,
            looks[chain].colour if rod.moving else None,
        )
        for chain, drawing in scene.chains.items()
        for rod in drawing.rods
    ]
    joints = [(chain, point) for chain, drawing in scene.chains.items() for point in drawing.balls]
    surfaces = {
        contact.name: contact_patch(contact, scene.contacts[contact.name], size)
        for contact in mechanism.contacts
        if contact.surface.known
    }
    balls = {contact.name: ball_radius(contact, size) for contact in mechanism.contacts}
    return Parts(size, hull, bars, joints, balls, surfaces)


def ball_radius(contact: Contact, size: float) -> float:
    """Radius of a contact's ball as drawn [m]: its own, where the file gives one."""
    return contact.ball_radius or BALL * size
