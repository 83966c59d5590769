"""The mechanism for the page's 3D view: what is fixed, what rides on the platform, what moves.

A point is one of {"fixed": [x, y, z]} in {S}, {"platform": [x, y, z]} in {M}, or
{"columns": [i, j, k]}: numbers of the columns with its coordinates in {S}. Metres throughout.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import Scene, contact_normals, contact_patch, place, platform_hull, styles
from ..scene.chains import PLATFORM_JOINT
from .page_columns import Columns

if TYPE_CHECKING:
    from ...mechanism import Mechanism
    from ...results.solution import Solution

SIZE = 0.26  # the size that radii and arrows are stated in, over the diagonal of everything
ARROW = 0.9  # longest arrow
ONE_SCALE = 0.4  # of loads and contact forces, if the smaller ones are at least this part
TRIAD = 0.4  # arms of the coordinate triad, before they are rounded
ROUND = (1.0, 2.0, 5.0, 10.0)
WIDE = (1.0, 99.0)  # percent of its samples that the picture must hold of each marker


def machine(solution: Solution, columns: Columns) -> dict[str, Any]:
    """Everything the 3D view draws."""
    mechanism = solution.mechanism
    scene = place(mechanism, solution["pose"].values, solution["joint"].values)
    vertices, faces = platform_hull(mechanism)
    cloud = _cloud(scene, vertices)
    size = SIZE * float(np.linalg.norm(np.nanmax(cloud, axis=0) - np.nanmin(cloud, axis=0)))
    rods, joints = _chains(mechanism, scene, columns)
    arrows = [*_contact_arrows(solution, scene, columns, size), *_load_arrow(solution, columns)]
    scales = _scales(arrows, size)
    ends = [a.far_end(scene.on_platform(a.at), scales[a.kind]["metresPerNewton"]) for a in arrows]
    everything = np.vstack([cloud, reach(solution), *ends])
    low, high = _box(everything, size)
    arm = _rounded(TRIAD * size)
    triad = low + arm * np.vstack([np.zeros(3), np.eye(3)])
    surfaces = list(_surfaces(mechanism, scene, size))
    return {
        "size": size,
        "pose": [
            columns.add(f"pose.{name}", solution["pose"].values[:, i])
            for i, name in enumerate(solution["coordinate"].values)
        ],
        "hull": {"vertices": vertices.tolist(), "faces": faces.tolist()},
        "rods": rods,
        "joints": joints,
        "balls": [
            {"name": c.name, "at": {"platform": list(c.point)}, "radius": ball_radius(c, size)}
            for c in mechanism.contacts
        ],
        "landmarks": [
            {"name": name, "at": {"platform": list(point)}}
            for name, point in mechanism.platform.points.items()
        ],
        "markers": markers(solution, columns),
        "surfaces": surfaces,
        "undrawn": _undrawn(mechanism, surfaces),
        "arrows": [arrow.description for arrow in arrows],
        "scales": {kind: scale for kind, scale in scales.items() if scale["largest"]},
        "traces": list(_traces(solution)),
        "range": [[float(a), float(b)] for a, b in zip(low, high, strict=True)],
        "triad": {"origin": low.tolist(), "arm": arm},
        "extent": _extremes(np.vstack([everything, triad])).tolist(),
    }


def ball_radius(contact: Any, size: float) -> float:
    """Radius of a contact's ball as drawn [m]: its own, where the file gives one."""
    return contact.ball_radius or 0.08 * size


def _chains(
    mechanism: Mechanism, scene: Scene, columns: Columns
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    rods, joints = [], []
    looks = styles(mechanism.chain_names)
    for chain, look in zip(mechanism.chains, looks, strict=True):
        drawing = scene.chains[chain.name]
        at: dict[str, dict[str, Any]] = {}
        for name, point in drawing.points.items():
            if name == PLATFORM_JOINT:
                at[name] = {"platform": list(chain.platform)}
            elif point.ndim == 1:
                at[name] = {"fixed": point.tolist()}
            else:
                at[name] = {"columns": columns.add_vector(f"point.{chain.name}.{name}", point)}
        rods += [
            {
                "chain": chain.name,
                "body": rod.body,
                "from": at[rod.start],
                "to": at[rod.end],
                "thickness": rod.thickness,
                "colour": look.colour if rod.moving else None,
            }
            for rod in drawing.rods
        ]
        joints += [at[name] for name in drawing.balls]
    return rods, joints


def _surfaces(mechanism: Mechanism, scene: Scene, size: float) -> Iterator[dict[str, Any]]:
    for contact in mechanism.contacts:
        if not contact.surface.known:
            continue
        patch = contact_patch(contact, scene.contacts[contact.name], size)
        finite = np.where(np.isfinite(patch.vertices), patch.vertices, 0.0)
        yield {
            "name": contact.name,
            "vertices": finite.tolist(),
            "faces": patch.faces.tolist(),
            "outline": patch.outline.tolist(),
            "bounded": patch.bounded,
        }


def _undrawn(mechanism: Mechanism, surfaces: Sequence[dict[str, Any]]) -> list[str]:
    """Contacts of whose surface there is nothing to draw."""
    drawn = {surface["name"] for surface in surfaces if surface["faces"]}
    return [name for name in mechanism.contact_names if name not in drawn]


@dataclass(frozen=True)
class Arrow:
    """A force, (N, 3) [N] in {S}, at a point of the platform; `gap`: how far off the arrow ends.

    A load leaves its point; a contact force points at the ball that it pushes.
    """

    kind: str
    at: tuple[float, ...]
    force: np.ndarray
    gap: float
    columns: list[int]

    @property
    def largest(self) -> float:
        size = np.linalg.norm(self.force, axis=1)
        return float(size[np.isfinite(size)].max(initial=0.0))

    @property
    def into(self) -> bool:
        return self.kind == "contact"

    def far_end(self, at: np.ndarray, scale: float) -> np.ndarray:
        """The end away from the platform's point at (N, 3), (N, 3) [m]."""
        return at + (-scale if self.into else scale) * self.force

    @property
    def description(self) -> dict[str, Any]:
        at = {"platform": list(self.at)}
        return {
            "kind": self.kind,
            "at": at,
            "gap": self.gap,
            "into": self.into,
            "columns": self.columns,
        }


def _scales(arrows: Sequence[Arrow], size: float) -> dict[str, dict[str, float]]:
    """Of each kind of force: metres a newton, and the largest [N].

    Small contact forces under a large load have a scale of their own, or nobody would see them.
    """
    largest: dict[str, float] = {}
    for arrow in arrows:
        largest[arrow.kind] = max(largest.get(arrow.kind, 0.0), arrow.largest)
    most = max(largest.values(), default=0.0)
    together = all(value >= ONE_SCALE * most for value in largest.values() if value)
    return {
        kind: {
            "largest": value,
            "metresPerNewton": ARROW * size / (most if together else value) if value else 0.0,
        }
        for kind, value in largest.items()
    }


def _contact_arrows(
    solution: Solution, scene: Scene, columns: Columns, size: float
) -> Iterator[Arrow]:
    forces = solution["contact_force"].values
    for i, contact in enumerate(solution.mechanism.contacts):
        if contact.surface.known:
            normals = contact_normals(contact, scene.contacts[contact.name])
        else:
            normals = solution["contact_normal"].values[:, i]
        vector = forces[:, i, None] * normals
        numbers = columns.add_vector(f"contact_vector.{contact.name}", vector)
        # From the ball's skin, or a small force would hide in it.
        yield Arrow("contact", contact.point, vector, ball_radius(contact, size), numbers)


def _load_arrow(solution: Solution, columns: Columns) -> Iterator[Arrow]:
    force = solution["load"].values[:, :3]
    if not np.nan_to_num(force).any():
        return
    points = solution.mechanism.platform.points
    at = points.get(solution.options["load_point"] or "", (0.0, 0.0, 0.0))
    names = solution["component"].values[:3]
    numbers = [columns.add(f"load.{name}", force[:, i]) for i, name in enumerate(names)]
    yield Arrow("load", at, force, 0.0, numbers)


def _traces(solution: Solution) -> Iterator[dict[str, Any]]:
    """Paths to draw: the guided landmark (else the incisor, else the first) and the balls."""
    mechanism = solution.mechanism
    points = mechanism.platform.points
    wanted = [solution.options["landmark"], "incisor", *points]
    guide = next((name for name in wanted if name in points), "")
    yield {"name": guide or "platform centre", "at": list(points.get(guide, (0.0, 0.0, 0.0)))}
    for contact in mechanism.contacts:
        yield {"name": contact.name, "at": list(contact.point)}


def _cloud(scene: Scene, hull: np.ndarray) -> np.ndarray:
    """Every place that a point of the mechanism is ever at, (P, 3) [m]."""
    clouds = [p.reshape(-1, 3) for d in scene.chains.values() for p in d.points.values()]
    step = max(len(scene.position) // 200, 1)
    corners = scene.position[::step, None] + np.einsum("nij,vj->nvi", scene.rotation[::step], hull)
    return np.vstack([*clouds, corners.reshape(-1, 3), *scene.contacts.values(), hull])


def _box(cloud: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners, (3,) each, of a box round everything that is ever shown [m]."""
    spare = 0.15 * size
    return np.nanmin(cloud, axis=0) - spare, np.nanmax(cloud, axis=0) + spare


def _extremes(cloud: np.ndarray) -> np.ndarray:
    """The points that lie furthest out in 26 directions, (E, 3): what a camera must see."""
    points = cloud[np.isfinite(cloud).all(axis=1)]
    steps = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    return points[np.unique(np.argmax(points @ steps.T, axis=0))]


def _rounded(length: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * min(ROUND, key=lambda digit: abs(digit - length / power)))


def markers(solution: Solution, columns: Columns) -> list[dict[str, Any]]:
    """Measured markers: name, body, and the numbers of the columns of its place."""
    if "marker_place" not in solution:
        return []
    places, names = solution["marker_place"].values, solution["marker"].values
    return [
        {
            "name": str(name),
            "body": str(body),
            "columns": columns.add_vector(f"marker.{name}", places[:, i]),
        }
        for i, (name, body) in enumerate(zip(names, solution["marker_body"].values, strict=True))
    ]


def reach(solution: Solution) -> np.ndarray:
    """Corners, (2 m, 3) [m], between which each marker mostly is."""
    if "marker_place" not in solution:
        return np.empty((0, 3))
    places = solution["marker_place"].values
    seen = [p[np.isfinite(p).all(axis=1)] for p in places.transpose(1, 0, 2)]
    corners = [c for p in seen if len(p) for c in np.percentile(p, WIDE, axis=0)]
    return np.array(corners).reshape(-1, 3)
