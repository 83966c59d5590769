"""A contact surface of one's own: its table with its equation, and the line that registers it."""

from __future__ import annotations

from typing import Any, Literal

import casadi as ca
from pydantic import Field

from condyle.mechanism.quantities import Length, Number
from condyle.mechanism.surface import SURFACES, SurfaceTable


class Wave(SurfaceTable):
    """z = offset + slope x + height sin(2 pi x / pitch)."""

    kind: Literal["wave"] = "wave"
    offset: Length
    slope: Number = 0.0
    height: Length = Field(default=1e-4, description="of a crest over the plane")
    pitch: Length = Field(default=0.1, description="from crest to crest")

    @staticmethod
    def equation(point: Any, f: Any) -> Any:
        crest = f.height * ca.sin(2 * ca.pi * point[0] / f.pitch)
        return point[2] - f.offset - f.slope * point[0] - crest


def add() -> None:
    SURFACES["wave"] = Wave
