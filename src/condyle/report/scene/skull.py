"""What a jaw's file knows of its skull: where muscles begin above the teeth, and the joints' walls.

A convex hull of these stands for the skull, and the row of the lower teeth at home for the upper
one, which it meets there. They are for pictures alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...mechanism import Mechanism
from ...mechanism.vocabulary import of_muscles
from .jaw_mesh import jaw_of
from .parts import hull_of
from .patches import Patch

ROW = np.linspace(-2.5, 2.5, 41)  # places along the arch, from the right molars to the left ones


@dataclass(frozen=True)
class Skull:
    """A shell fixed in {S}: vertices (V, 3) [m]; triangles (F, 3), counter-clockwise seen from
    outside; teeth: a line along the edges of the upper ones, (41, 3) [m]."""

    vertices: np.ndarray
    faces: np.ndarray
    teeth: np.ndarray


def skull_of(mechanism: Mechanism, walls: Iterable[Patch]) -> Skull | None:
    """The skull of a mechanism of muscles with the landmarks of a jaw; else None.

    Args: walls: of its joints. What begins below the teeth, as on the hyoid bone, is left out.
    """
    jaw = jaw_of(mechanism) if of_muscles(mechanism) else None
    if jaw is None:
        return None
    origins = np.array([chain.base for chain in mechanism.chains])
    above = origins[(origins - jaw.incisor) @ jaw.z > 0]
    points = np.vstack([above, *(wall.vertices for wall in walls)])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(above):
        return None
    teeth = np.array([jaw.arch(place)[0] for place in ROW])
    return Skull(*hull_of(points, 0.05 * jaw.body_height), teeth)
