"""A wall: a plane that can push a point of the platform, and is no contact of the kinematics."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, StrictBool

from .quantities import Damping, Name, Point, PositiveLength, Stiffness
from .surface.plane import Plane
from .table import Table


class FossaWall(Table):
    """A plane beside the path of a platform point, such as the medial wall of a fossa.

    Its gap is the distance of the point from it, negative beyond. In inverse dynamics it can bear a
    force along its normal where the gap is below `reach`; in simulations it is a spring and damper
    that only pushes, where the gap is negative.
    """

    implied: ClassVar[tuple[str, ...]] = ("damping", "enabled")

    name: Name
    point: Point = Field(description="of the platform, in {M}")
    surface: Plane
    side: Literal["above", "below"] = Field(description="where the point may be")
    reach: PositiveLength = Field(description="gap below which it can bear a force")
    stiffness: Stiffness = Field(description="in simulations")
    damping: Damping = Field(default=0.0, description="in simulations, while it is touched")
    enabled: StrictBool = Field(default=True, description="whether it is there at all")

    @property
    def push(self) -> int:
        """1 where it pushes towards larger z, else -1."""
        return 1 if self.side == "above" else -1

    @property
    def normal(self) -> np.ndarray:
        """Unit vector towards the point's side, (3,) in {S}."""
        normal = self.push * np.array([*(-s for s in self.surface.slope), 1.0])
        return normal / np.linalg.norm(normal)

    @property
    def gap(self) -> float:
        """The gap at home [m]."""
        return float(self.normal @ np.subtract(self.point, (0.0, 0.0, self.surface.offset)))
