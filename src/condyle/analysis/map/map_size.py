"""How large a workspace is, and how much of it around home is free."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, brief
from ...kinematics.singularities import NEAR_SINGULAR
from ...mechanism import Mechanism, dumps
from ...mechanism.mechanism import COORDINATES
from ...model.given import as_model
from ...model.model import Model, derive
from ...results.solution import Results
from .block import Setup
from .free_space import Ball, Box, FreeSpace, greatest_ball, greatest_box
from .map_files import grid_and_reach, is_map, open_map
from .volume import Volume, reachable_volume

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class WorkspaceSize:
    """Reachable volume, and the greatest free ball and box around home.

    box, ball: None where home is outside the range of the map.  unit: of the volume.
    """

    volume: Volume
    unit: str
    ball: Ball | None
    box: Box | None
    axes: tuple[str, ...]
    margin: float

    @property
    def data(self) -> dict[str, Any]:
        """For JSON; SI."""
        return {
            "volume": asdict(self.volume) | {"unit": self.unit},
            "ball": asdict(self.ball) if self.ball else None,
            "box": asdict(self.box) if self.box else None,
            "margin": self.margin,
        }


def workspace_size(
    map: xr.Dataset | str | os.PathLike[str],
    margin: float = NEAR_SINGULAR,
    model: Model | Mechanism | str | os.PathLike[str] | None = None,
) -> WorkspaceSize:
    """Volume of the reachable set of a map, and the greatest free ball and box around home.

    Args:   map: of `workspace_map`, or its file.
            margin: minimum singularity ratio in ball and box, 0 to 1.
            model: that of the map, if it is at hand; default: derived anew.
    Raises: InputError: for anything but a map, a margin out of range, or a model of another
            mechanism.
    """
    if isinstance(margin, bool) or not isinstance(margin, int | float) or not 0 <= margin <= 1:
        raise InputError(f"margin: expected a number from 0 to 1, got {brief(margin)}")
    dataset = open_map(map) if isinstance(map, str | os.PathLike) else map
    if not is_map(dataset):
        raise InputError(f"map: expected a map or its file, got {type(dataset).__name__}")
    if model is None:
        made = derive(Results(dataset).mechanism, distribution=dataset.attrs["distribution"])
    elif dumps((made := as_model(model)).mechanism) != dataset.attrs["mechanism"]:
        name = dataset.attrs["mechanism_name"]
        raise InputError(f'model: is of another mechanism than the map, of "{name}"; leave it out')
    grid, reach = grid_and_reach(dataset, made)
    free = FreeSpace(Setup(made, reach, np.array(dataset.attrs["load"], dtype=float)), margin)
    inside = all(axis.low < 0 < axis.high for axis in grid.axes)
    units = ["m" if axis.name in COORDINATES[:3] else "rad" for axis in grid.axes]
    powers = {unit: units.count(unit) for unit in units}
    return WorkspaceSize(
        reachable_volume(reach.margin, grid),
        " ".join(unit + (f"^{n}" if n > 1 else "") for unit, n in powers.items()),
        greatest_ball(free, grid) if inside else None,
        greatest_box(free, grid) if inside else None,
        tuple(axis.name for axis in grid.axes),
        float(margin),
    )
