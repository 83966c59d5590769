"""A plane across an axis of {S}: where a point keeps one of its coordinates."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from ..quantities import Length
from .base import Coordinates, Scalar, SurfaceTable
from .freedom import Freedom, tangents

Axis = Literal["x", "y", "z"]


class CoordinatePlane(SurfaceTable):
    """x = offset, y = offset or z = offset. A ball joint is three of them through one point."""

    kind: Literal["coordinate"] = "coordinate"
    axis: Axis = Field(description="of {S}, along which the point does not move")
    offset: Length

    by_numpy: ClassVar[bool] = True

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        return point["xyz".index(self.axis)] - c[0]

    def joints(self, point: np.ndarray, normal: np.ndarray) -> tuple[Freedom, ...]:
        u, v = tangents(normal)
        return Freedom("slide", u, point), Freedom("slide", v, point)

    @staticmethod
    def beyond(f: Any, distance: Any) -> Any:
        return SimpleNamespace(offset=f.offset + distance)

    @property
    def form(self) -> str:
        return f"{self.kind} {self.axis}"

    @classmethod
    def of_form(cls, form: str) -> Self:
        return cls.model_construct(axis=form.rpartition(" ")[2])
