"""What a picture in space draws of a mechanism, and how large; page and live page only move it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...mechanism import Contact, Mechanism
from ...mechanism.ball_joint import of_joints
from ...mechanism.home import characteristic_length
from ...mechanism.vocabulary import of_muscles
from .colours import LIGHT, styles
from .jaw_mesh import BodyMesh, jaw_body
from .muscles import bands
from .patches import Patch, contact_patch
from .place import Scene
from .solids import COARSE, RINGS, Solid, ball, tube

SIZE = 0.26  # the size that all others are stated in, over the diagonal of everything
ROD, JOINT, BALL = 0.022, 0.042, 0.08  # radii, where the file gives none
# Where cameras stand, and what is up.
VIEWS = {
    "Front": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "Side": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "Top": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "Oblique": ((1.15, -1.15, 0.6), (0.0, 0.0, 1.0)),
}
FLAT = 0.1  # thinnest over longest side of a machine, below which it is seen from its broad side


@dataclass(frozen=True)
class SceneParts:
    """What a picture in space shows of a mechanism [m], whatever draws it.

    body: the platform.   solids: all that is drawn, the platform's first.
    balls: radius by contact.   surfaces: by contact, of those whose equation is known; none of a
    ball joint.
    view: of `VIEWS`, with which a picture opens.
    """

    size: float
    body: BodyMesh
    solids: list[Solid]
    balls: dict[str, float]
    surfaces: dict[str, Patch]
    view: str

    def of_group(self, *groups: str) -> list[Solid]:
        return [solid for solid in self.solids if solid.group in groups]


def cloud(scene: Scene, body: np.ndarray) -> np.ndarray:
    """Every place that a point of the mechanism is ever at, (P, 3) [m]; body: (V, 3) in {M}."""
    clouds = [p.reshape(-1, 3) for d in scene.chains.values() for p in d.points.values()]
    step = max(len(scene.position) // 200, 1)
    corners = scene.position[::step, None] + np.einsum("nij,vj->nvi", scene.rotation[::step], body)
    return np.vstack([*clouds, corners.reshape(-1, 3), *scene.contacts.values(), body])


def parts_of(mechanism: Mechanism, scene: Scene) -> SceneParts:
    """The solids, as large as the mechanism is at the poses of a scene."""
    body = platform_body(mechanism)
    points = cloud(scene, body.vertices)
    sides = np.nanmax(points, axis=0) - np.nanmin(points, axis=0)
    flat = sides.min() < FLAT * sides.max()
    view = ("Front", "Side", "Top")[np.argmin(sides)] if flat else "Oblique"
    size = SIZE * float(np.linalg.norm(sides))
    balls = {contact.name: ball_radius(contact, size) for contact in mechanism.contacts}
    sockets = of_joints(mechanism.contacts)
    surfaces = {
        contact.name: contact_patch(contact, scene.contacts[contact.name], size)
        for contact in mechanism.contacts
        if contact.surface.known and contact.name not in sockets
    }
    held = [(c.name, c.point, "balls", balls[c.name], "ball") for c in mechanism.contacts]
    held += [
        (name, point, "landmarks", ROD * size, "ink")
        for name, point in mechanism.platform.points.items()
    ]
    solids = list(_platform(body))
    for name, point, group, radius, colour in held:
        vertices, faces = ball(radius, RINGS if group == "balls" else COARSE)
        solids.append(Solid(group, name, vertices + point, faces, colour, "platform"))
    solids += _chains(mechanism, scene, size)
    solids += [
        Solid("surfaces", name, np.nan_to_num(patch.vertices), patch.faces, "surface")
        for name, patch in surfaces.items()
    ]
    return SceneParts(size, body, solids, balls, surfaces, view)


def _platform(body: BodyMesh) -> Iterator[Solid]:
    if body.teeth is None:
        yield Solid("platform", "body", body.vertices, body.faces, "platform", "platform")
        return
    bone, teeth = np.split(body.faces, [body.teeth])
    yield Solid("platform", "bone", body.vertices, bone, "bone", "platform")
    yield Solid("platform", "teeth", body.vertices, teeth, "teeth", "platform")


def _chains(mechanism: Mechanism, scene: Scene, size: float) -> Iterator[Solid]:
    """Muscles as bands; other chains and ligaments as rods, with their joints."""
    names = mechanism.chain_names
    looks = {n: style.colour for n, style in zip(names, styles(names), strict=True)}
    muscles = bands(mechanism, scene, size)
    yield from muscles
    for chain, drawing in scene.chains.items():
        for rod in drawing.rods if not muscles or chain not in looks else ():
            mesh = tube(2 * [ROD * size * rod.thickness], [0.0, 1.0])
            colour = looks.get(chain, "neutral") if rod.moving else "neutral"
            yield Solid("chains", chain, *mesh, colour, "line", (rod.start, rod.end))
        for point in drawing.balls:
            yield Solid("joints", chain, *ball(JOINT * size, COARSE), "neutral", "point", (point,))


def ball_radius(contact: Contact, size: float) -> float:
    """Radius of a contact's ball as drawn [m]: its own, where the file gives one."""
    return contact.ball_radius or BALL * size


def platform_body(mechanism: Mechanism) -> BodyMesh:
    """The platform as drawn: a jaw where muscles drive one, else the hull of its points."""
    jaw = jaw_body(mechanism) if of_muscles(mechanism) else None
    return jaw or BodyMesh(*platform_hull(mechanism))


SLAB = 0.04  # half thickness of a flat platform over the characteristic length


def platform_hull(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    """Hull of the joints, contact points and landmarks in {M}: see `hull_of`."""
    points = [chain.platform for chain in mechanism.chains]
    points += [contact.point for contact in mechanism.contacts]
    points += list(mechanism.platform.points.values())
    return hull_of(np.array(points), SLAB * characteristic_length(mechanism))


def hull_of(points: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray]:
    """Convex hull of points (P, 3) [m].

    Points in one plane get a thickness of twice `half`; points on one line a small body round it.
    Returns: vertices (V, 3) [m]; triangles (F, 3), counter-clockwise seen from outside.
    """
    from scipy.spatial import ConvexHull

    cloud = _with_thickness(points, half)
    hull = ConvexHull(cloud)
    number = np.full(len(cloud), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    vertices, faces = cloud[hull.vertices], number[hull.simplices]
    return vertices, _outward(vertices, faces)


def _with_thickness(points: np.ndarray, half: float) -> np.ndarray:
    """Points spread along the directions in which they do not extend."""
    spread = points - points.mean(axis=0)
    _, sigma, directions = np.linalg.svd(spread, full_matrices=True)
    sizes = np.append(sigma, np.zeros(3 - len(sigma)))
    for direction, size in zip(directions, sizes, strict=True):
        if size < half:
            points = np.vstack([points - half * direction, points + half * direction])
    return points


def _outward(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = ((a - vertices.mean(axis=0)) * np.cross(b - a, c - a)).sum(axis=1) < 0
    return np.where(inward[:, None], faces[:, ::-1], faces)


class Appearance:
    """The shapes and colours of one mechanism at home.

    colours: of its chains, "#rrggbb";  hull: vertices of the platform, (V, 3) [m] in {M}.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        names = mechanism.chain_names
        self.colours: dict[str, str] = {
            n: LIGHT[s.colour] for n, s in zip(names, styles(names), strict=True)
        }
        self.hull: np.ndarray = platform_hull(mechanism)[0]
        self._size = characteristic_length(mechanism)

    def patch(self, contact: Contact) -> tuple[np.ndarray, np.ndarray]:
        """The wall within its bounds, or near home: vertices (V, 3) [m] in {S}, faces (F, 3)."""
        patch = contact_patch(contact, np.array([contact.point]), self._size)
        return patch.vertices, patch.faces
