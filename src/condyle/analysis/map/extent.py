"""A map in numbers: how much can be reached, and how much room there is around home."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ...kinematics.singularities import NEAR_SINGULAR
from ...mechanism.mechanism import COORDINATES
from .axes import Grid
from .block import Asked
from .room import Ball, Box, Free, greatest_ball, greatest_box
from .volume import Volume, reachable_volume


@dataclass(frozen=True)
class Numbers:
    """box, ball: None where home is outside the range.  unit: of the volume."""

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


def numbers_of(asked: Asked, grid: Grid, margin: float = NEAR_SINGULAR) -> Numbers:
    """All of a map's numbers.

    Args: margin: least singularity ratio in ball and box.
    """
    units = ["m" if axis.name in COORDINATES[:3] else "rad" for axis in grid.axes]
    volume = reachable_volume(asked.reach.margin, grid)
    free = Free(asked, margin)
    inside = all(axis.low < 0 < axis.high for axis in grid.axes)
    return Numbers(
        volume,
        _power(units),
        greatest_ball(free, grid) if inside else None,
        greatest_box(free, grid) if inside else None,
        tuple(axis.name for axis in grid.axes),
        margin,
    )


def _power(units: list[str]) -> str:
    """'m^2 rad' of m, m and rad."""
    counts: Mapping[str, int] = {unit: units.count(unit) for unit in units}
    return " ".join(unit + (f"^{n}" if n > 1 else "") for unit, n in counts.items())
