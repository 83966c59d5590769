"""Forces of a picture in space, as arrows, and the paths that it draws."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...mechanism import Mechanism
from .parts import SceneParts
from .patches import contact_normals
from .place import Scene

if TYPE_CHECKING:
    import xarray as xr

Point = tuple[float, ...]

ARROW = 0.9  # longest arrow over the size of the picture
SHAFT = 0.026  # radius of its shaft over the same
ONE_SCALE = 0.4  # of loads and contact forces, if the smaller ones are at least this part
TINTS = {"contact": "ball", "load": "ink"}  # roles of colour


@dataclass(frozen=True)
class Force:
    """A force over time on a point of the platform.

    kind: "load", which leaves its point, or "contact", which points at the ball that it pushes.
    owner: its contact, or load point.   at: (3,) [m] in {M}.   vector: (N, 3) [N] in {S}.
    gap: radius of the ball at whose skin an arrow ends [m], or a small force would hide in it.
    """

    kind: str
    owner: str
    at: Point
    vector: np.ndarray
    gap: float = 0.0

    @property
    def into(self) -> bool:
        return self.kind == "contact"

    @property
    def size(self) -> np.ndarray:
        """Magnitudes, (N,) [N]."""
        found: np.ndarray = np.linalg.norm(self.vector, axis=1)
        return found

    @property
    def largest(self) -> float:
        return float(np.nanmax(self.size, initial=0.0))

    def ends(self, scene: Scene, scale: float) -> tuple[np.ndarray, np.ndarray]:
        """Tails and heads of its arrows at every sample, (N, 3) [m]; scale: metres a newton."""
        place, arrow = scene.on_platform(self.at), scale * self.vector
        if not self.into:
            return place, place + arrow
        unit = self.vector / np.maximum(self.size, 1e-300)[:, None]
        head = place - self.gap * unit
        return head - arrow, head


def contact_forces(
    mechanism: Mechanism,
    scene: Scene,
    parts: SceneParts,
    force: np.ndarray,
    normal: np.ndarray | None = None,
) -> Iterator[Force]:
    """Contact forces of given sizes along the normals, (N, k) [N].

    Args: normal: (N, k, 3), of surfaces whose equation is not known.
    """
    for i, contact in enumerate(mechanism.contacts):
        if contact.surface.known or normal is None:
            normals = contact_normals(contact, scene.contacts[contact.name])
        else:
            normals = normal[:, i]
        vector = force[:, i, None] * normals
        yield Force("contact", contact.name, contact.point, vector, parts.balls[contact.name])


def forces_of(solution: xr.Dataset, scene: Scene, parts: SceneParts) -> list[Force]:
    """Contact forces and the load of a solution, at the samples of a scene."""
    mechanism, values = solution.condyle.mechanism, solution["contact_force"].values
    normal = solution["contact_normal"].values if "contact_normal" in solution else None
    forces = list(contact_forces(mechanism, scene, parts, values, normal))
    load = solution["load"].values[:, :3]
    if np.nan_to_num(load).any():
        name = solution.condyle.options.get("load_point") or ""
        at = mechanism.platform.points.get(name, (0.0, 0.0, 0.0))
        forces.append(Force("load", name, at, load))
    return forces


def force_scales(forces: Sequence[Force], size: float) -> dict[str, float]:
    """Lengths of arrows, metres a newton, by kind of force.

    Small contact forces under a large load have a scale of their own, or nobody would see them.
    """
    largest: dict[str, float] = {}
    for force in forces:
        largest[force.kind] = max(largest.get(force.kind, 0.0), force.largest)
    most = max(largest.values(), default=0.0)
    together = all(value >= ONE_SCALE * most for value in largest.values() if value)
    return {
        kind: ARROW * size / (most if together else value) if value else 0.0
        for kind, value in largest.items()
    }


def trails(solution: xr.Dataset) -> list[tuple[str, Point]]:
    """Points of the platform whose paths are drawn, in {M} [m]: the guided landmark (else the
    incisor, else the first, else the centre), and the contacts."""
    mechanism = solution.condyle.mechanism
    points = mechanism.platform.points
    wanted = [solution.condyle.options.get("landmark"), "incisor", *points]
    guide = next((name for name in wanted if name in points), "")
    found = [(guide or "platform centre", points.get(guide, (0.0, 0.0, 0.0)))]
    return found + [(contact.name, contact.point) for contact in mechanism.contacts]
