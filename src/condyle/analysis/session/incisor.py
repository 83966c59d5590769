"""Where the incisal point is, in the words of a clinic: gape, lateral excursion, protrusion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism.coordinates import rotations

if TYPE_CHECKING:
    from ...mechanism.mechanism import Mechanism

POINT = "incisor"
PATHS = ("protrusion", "lateral", "gape")


def has_incisor(mechanism: Mechanism) -> bool:
    return POINT in mechanism.platform.points


def way_of(point: Any, pose: np.ndarray, axes: np.ndarray | None = None) -> np.ndarray:
    """Protrusion (forwards), lateral excursion (to the left) and gape (downwards), (N, 3) [m].

    Of a point of the platform, (3,) [m] in {M}, from where it is with the teeth closed.

    Args: pose: X_EE, (N, 6);  axes: forward, left and up in {S}, (3, 3), a row each; default:
            those of {S}.
    """
    point = np.array(point)
    way = rotations(pose[:, 3:]) @ point + pose[:, :3] - point
    return way @ (np.eye(3) if axes is None else axes).T * [1.0, 1.0, -1.0]
