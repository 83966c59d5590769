"""The platform: its mass, its inertia and its landmarks."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from .quantities import Mass, Moment, Name, Point, Product
from .table import FrozenTable, Table


class Inertia(Table):
    """Entries of the inertia tensor about O_M along the axes of {M}, kg m^2."""

    xx: Moment
    yy: Moment
    zz: Moment
    xy: Product = 0.0
    xz: Product = 0.0
    yz: Product = 0.0

    def tensor(self) -> np.ndarray:
        """The symmetric tensor, (3, 3) [kg m^2]."""
        return np.array(
            [
                [self.xx, self.xy, self.xz],
                [self.xy, self.yy, self.yz],
                [self.xz, self.yz, self.zz],
            ]
        )

    def principal(self) -> np.ndarray:
        """The principal moments, rising, (3,) [kg m^2]."""
        return np.linalg.eigvalsh(self.tensor())

    @model_validator(mode="after")
    def _physical(self) -> Self:
        smallest, middle, largest = self.principal()
        if smallest <= 0:
            raise ValueError(
                f"inertia must be positive definite; its principal moments are {smallest:.4g}, "
                f"{middle:.4g}, {largest:.4g} kg m^2"
            )
        if largest > (smallest + middle) * (1 + 1e-9):
            raise ValueError(
                "inertia breaks the triangle inequality: the largest principal moment "
                f"{largest:.4g} exceeds the sum of the others, {smallest + middle:.4g} kg m^2; "
                "no rigid body has such moments"
            )
        return self


class Platform(Table):
    """The moving body; {M} is at its mass centre."""

    mass: Mass
    inertia: Inertia
    points: Annotated[dict[Name, Point], AfterValidator(FrozenTable)] = Field(
        default_factory=FrozenTable, description="landmarks, in {M}"
    )
