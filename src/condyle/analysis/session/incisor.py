"""Where the incisal point is, in the words of a clinic: gape, lateral excursion, protrusion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...mechanism.coordinates import rotations

if TYPE_CHECKING:
    import xarray as xr

    from ...mechanism.mechanism import Mechanism

POINT = "incisor"
PATHS = ("protrusion", "lateral", "gape")


def has_incisor(mechanism: Mechanism) -> bool:
    return POINT in mechanism.platform.points


def incisor_path(solution: xr.Dataset, axes: np.ndarray | None = None) -> np.ndarray:
    """Protrusion (forwards), lateral excursion (to the left) and gape (downwards), (N, 3) [m].

    Of the incisal point, from where it is with the teeth closed.

    Args: axes: forward, left and up in {S}, (3, 3), a row each; default: those of {S}.
    """
    pose = solution["pose"].values
    point = np.array(solution.condyle.mechanism.platform.points[POINT])
    way = rotations(pose[:, 3:]) @ point + pose[:, :3] - point
    return way @ (np.eye(3) if axes is None else axes).T * [1.0, 1.0, -1.0]
