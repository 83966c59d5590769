"""Contact surfaces: the data of each kind and its equation phi(x, y, z) = 0 in {S}.

Every `phi` is a distance-like function in metres whose gradient points along the unit normal of
the file format: upwards for surfaces z = f(x, y), outwards for closed ones. It is written with
operations that numbers and CasADi symbols share, so that exact derivatives come from CasADi.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from .quantities import Length, Number, Table

Scalar = Any  # a float or a CasADi scalar
Coordinates = Any  # anything with [0], [1], [2]


class Plane(Table):
    """z = slope[0] x + slope[1] y + offset, [Cheng2023] eq. (1)."""

    kind: Literal["plane"] = "plane"
    slope: tuple[Number, Number]
    offset: Length

    closed: ClassVar[bool] = False

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        return point[2] - c[0] * point[0] - c[1] * point[1] - c[2]

    def constants(self) -> tuple[float, ...]:
        return (*self.slope, self.offset)


Surface = Annotated[Plane, Field(discriminator="kind")]
