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

from ..panel_list import activation_rows, activation_top
from ..scene import (
    ACTIVATION,
    DARK,
    LIGHT,
    MARKERS,
    ROLES,
    VIEWS,
    Scene,
    SceneParts,
    cloud,
    contact_normals,
    parts_of,
    place,
)
from ..scene.muscles import BELLY, FLAT, SIDES
from ..scene.parts import JOINT
from ..scene.place import PLATFORM_JOINT, of_ligament
from .page_columns import PageColumns

if TYPE_CHECKING:
    import xarray as xr


ARROW = 0.9  # longest arrow
ONE_SCALE = 0.4  # of loads and contact forces, if the smaller ones are at least this part
TRIAD = 0.4  # arms of the coordinate triad, before they are rounded
ROUND = (1.0, 2.0, 5.0, 10.0)
WIDE = (1.0, 99.0)  # percent of its samples that the picture must hold of each marker


def machine(solution: xr.Dataset, columns: PageColumns) -> dict[str, Any]:
    """Everything the 3D view draws."""
    mechanism = solution.condyle.mechanism
    scene = place(mechanism, solution["pose"].values, solution["joint"].values)
    parts = parts_of(mechanism, scene)
    size, body = parts.size, parts.body
    rods, joints, muscles = _chains(solution, parts, scene, columns)
    arrows = [*_contact_arrows(solution, scene, parts, columns), *_load_arrow(solution, columns)]
    scales = _scales(arrows, size)
    ends = [
        scene.on_platform(a.at)
        + (-1 if a.into else 1) * scales[a.kind]["metresPerNewton"] * a.force
        for a in arrows
    ]
    everything = np.vstack([cloud(scene, body.vertices), reach(solution), *ends])
    spare = 0.15 * size
    low, high = np.nanmin(everything, axis=0) - spare, np.nanmax(everything, axis=0) + spare
    arm = _rounded(TRIAD * size)
    triad = low + arm * np.vstack([np.zeros(3), np.eye(3)])
    surfaces = list(_surfaces(parts))
    drawn = {surface["name"] for surface in surfaces if surface["faces"]}
    return {
        "size": size,
        "views": {n: {"from": a, "up": up, "flat": flat} for n, (a, up, flat) in VIEWS.items()},
        "palette": {"light": LIGHT, "dark": DARK},
        "roles": ROLES,
        "markerStyles": {
            body: dict(zip(("colour", "symbol", "sign", "text"), look, strict=True))
            for body, look in MARKERS.items()
        },
        "pose": [
            columns.add(f"pose.{name}", solution["pose"].values[:, i])
            for i, name in enumerate(solution["coordinate"].values)
        ],
        "body": {
            "vertices": body.vertices.tolist(),
            "faces": body.faces.tolist(),
            "teeth": body.teeth,
        },
        "rods": rods,
        "muscles": muscles,
        "band": {
            "belly": BELLY,
            "flat": FLAT,
            "sides": SIDES,
            "colours": ACTIVATION,
            "top": activation_top(solution),
        },
        "joints": joints,
        "balls": [
            {"name": c.name, "at": {"platform": list(c.point)}, "radius": parts.balls[c.name]}
            for c in mechanism.contacts
        ],
        "landmarks": [
            {"name": name, "at": {"platform": list(point)}}
            for name, point in mechanism.platform.points.items()
        ],
        "markers": markers(solution, columns),
        "surfaces": surfaces,
        "undrawn": [name for name in mechanism.contact_names if name not in drawn],
        "arrows": [arrow.description for arrow in arrows],
        "scales": {kind: scale for kind, scale in scales.items() if scale["largest"]},
        "traces": list(_traces(solution)),
        "range": [[float(a), float(b)] for a, b in zip(low, high, strict=True)],
        "triad": {"origin": low.tolist(), "arm": arm},
        "extent": _extremes(np.vstack([everything, triad])).tolist(),
    }


def _chains(
    solution: xr.Dataset, parts: SceneParts, scene: Scene, columns: PageColumns
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], list[dict[str, Any]]]:
    """Rods, the places of joints with their radius, and muscles with what colours them."""
    mechanism = solution.condyle.mechanism
    at: dict[tuple[str, str], dict[str, Any]] = {}
    held = {chain.name: chain.platform for chain in mechanism.chains}
    held |= {of_ligament(one.name): one.platform for one in mechanism.ligaments}
    for chain, insertion in held.items():
        for name, point in scene.chains[chain].points.items():
            if name == PLATFORM_JOINT:
                found: dict[str, Any] = {"platform": list(insertion)}
            elif point.ndim == 1:
                found = {"fixed": point.tolist()}
            else:
                found = {"columns": columns.add_vector(f"point.{chain}.{name}", point)}
            at[chain, name] = found
    rods = []
    for bar in parts.bars:
        ends = {"from": at[bar.chain, bar.start], "to": at[bar.chain, bar.end]}
        facts = {"chain": bar.chain, "body": bar.body, "radius": bar.radius, "colour": bar.colour}
        rods.append(facts | ends)
    rows = {row.label: row for row in activation_rows(solution)} if parts.bands else {}
    muscles = []
    for band in parts.bands:
        facts = {"chain": band.chain, "width": band.width, "column": None, "scale": 1.0}
        if (row := rows.get(band.chain)) is not None:
            facts |= {"column": columns.add(row.column, row.values, line=True)}
            facts |= {"scale": 1.0 if row.scale is None else row.scale}
        muscles.append(facts | {"points": [at[band.chain, name] for name in band.points]})
    joints = [at[key] | {"radius": JOINT * parts.size} for key in parts.joints]
    return rods, joints, muscles


def _surfaces(parts: SceneParts) -> Iterator[dict[str, Any]]:
    for name, patch in parts.surfaces.items():
        yield {
            "name": name,
            "vertices": np.where(np.isfinite(patch.vertices), patch.vertices, 0.0).tolist(),
            "faces": patch.faces.tolist(),
            "outline": patch.outline.tolist(),
            "bounded": patch.bounded,
        }


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

    @property
    def description(self) -> dict[str, Any]:
        facts = {"kind": self.kind, "at": {"platform": list(self.at)}, "gap": self.gap}
        return facts | {"into": self.into, "columns": self.columns}


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
    solution: xr.Dataset, scene: Scene, parts: SceneParts, columns: PageColumns
) -> Iterator[Arrow]:
    forces = solution["contact_force"].values
    for i, contact in enumerate(solution.condyle.mechanism.contacts):
        if contact.surface.known:
            normals = contact_normals(contact, scene.contacts[contact.name])
        else:
            normals = solution["contact_normal"].values[:, i]
        vector = forces[:, i, None] * normals
        numbers = columns.add_vector(f"contact_vector.{contact.name}", vector)
        # From the ball's skin, or a small force would hide in it.
        yield Arrow("contact", contact.point, vector, parts.balls[contact.name], numbers)


def _load_arrow(solution: xr.Dataset, columns: PageColumns) -> Iterator[Arrow]:
    force = solution["load"].values[:, :3]
    if not np.nan_to_num(force).any():
        return
    points = solution.condyle.mechanism.platform.points
    at = points.get(solution.condyle.options["load_point"] or "", (0.0, 0.0, 0.0))
    names = solution["component"].values[:3]
    numbers = [columns.add(f"load.{name}", force[:, i]) for i, name in enumerate(names)]
    yield Arrow("load", at, force, 0.0, numbers)


def _traces(solution: xr.Dataset) -> Iterator[dict[str, Any]]:
    """Paths to draw: the guided landmark (else the incisor, else the first) and the balls."""
    mechanism = solution.condyle.mechanism
    points = mechanism.platform.points
    wanted = [solution.condyle.options["landmark"], "incisor", *points]
    guide = next((name for name in wanted if name in points), "")
    yield {"name": guide or "platform centre", "at": list(points.get(guide, (0.0, 0.0, 0.0)))}
    for contact in mechanism.contacts:
        yield {"name": contact.name, "at": list(contact.point)}


def _extremes(cloud: np.ndarray) -> np.ndarray:
    """The points that lie furthest out in 26 directions, (E, 3): what a camera must see."""
    points = cloud[np.isfinite(cloud).all(axis=1)]
    steps = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    return points[np.unique(np.argmax(points @ steps.T, axis=0))]


def _rounded(length: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * min(ROUND, key=lambda digit: abs(digit - length / power)))


def markers(solution: xr.Dataset, columns: PageColumns) -> list[dict[str, Any]]:
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


def reach(solution: xr.Dataset) -> np.ndarray:
    """Corners, (2 m, 3) [m], between which each marker mostly is."""
    if "marker_place" not in solution:
        return np.empty((0, 3))
    places = solution["marker_place"].values
    seen = [p[np.isfinite(p).all(axis=1)] for p in places.transpose(1, 0, 2)]
    corners = [c for p in seen if len(p) for c in np.percentile(p, WIDE, axis=0)]
    return np.array(corners).reshape(-1, 3)
