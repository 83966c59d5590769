"""The platform and the bodies of chains, as the tables of a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from .quantities import (
    Fraction,
    Length,
    Mass,
    MassOrNone,
    Moment,
    MomentOrNone,
    Name,
    NonNegativeLength,
    Point,
    Product,
    Stiffness,
)
from .table import FrozenTable, Table


class Inertia(Table):
    """Entries of the inertia tensor about the mass centre along the axes of {M}, kg m^2."""

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

    @staticmethod
    def entries_of(tensor: np.ndarray) -> dict[str, float]:
        """The table of a symmetric tensor, (3, 3) [kg m^2]."""
        keys = Inertia.model_fields
        return {key: float(tensor["xyz".index(key[0]), "xyz".index(key[1])]) for key in keys}

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
    """The moving body."""

    implied: ClassVar[tuple[str, ...]] = ("com",)

    mass: Mass = Field(description="of the platform")
    com: Point = Field(default=(0.0, 0.0, 0.0), description="mass centre of the platform, in {M}")
    inertia: Inertia
    points: Annotated[dict[Name, Point], AfterValidator(FrozenTable)] = Field(
        default_factory=FrozenTable, description="landmarks, in {M}"
    )


def check_axial(axial: float, info: ValidationInfo) -> float:
    """The triangle inequality on the principal moments (transverse, transverse, axial)."""
    transverse = info.data.get("transverse")
    if transverse is not None and axial > 2 * transverse * (1 + 1e-12):
        raise ValueError(
            f"inertia breaks the triangle inequality: axial {axial:g} kg m^2 is more than "
            f"twice transverse {transverse:g} kg m^2; no rigid body has such moments"
        )
    return axial


AXIAL = "axial, for small deflections; without it rigid"


class Rod(Table):
    """A rod with two ball ends, symmetric about its line."""

    mass: MassOrNone
    com: Fraction = Field(description="mass centre: fraction of the way to the platform joint")
    transverse: MomentOrNone = Field(description="central moment of inertia across the rod")
    axial: MomentOrNone = Field(description="moment of inertia along the rod")
    stiffness: Stiffness | None = Field(default=None, description=AXIAL)

    _triangle = field_validator("axial")(check_axial)


class Crank(Table):
    implied: ClassVar[tuple[str, ...]] = ("mass", "com")

    inertia: Moment = Field(description="about the shaft")
    mass: MassOrNone = 0.0
    com: Length = Field(
        default=0.0, description="mass centre: distance from the shaft towards crank_tip"
    )

    @model_validator(mode="after")
    def _about_the_shaft(self) -> Self:
        least = self.mass * self.com**2
        if least > self.inertia * (1 + 1e-12):
            raise ValueError(
                f"inertia is about the shaft: {self.inertia:g} kg m^2 is less than mass com^2, "
                f"{least:g} kg m^2; no rigid body has such moments"
            )
        return self


class Slider(Table):
    mass: MassOrNone = Field(description="its mass centre is at its joint")


class LegBody(Table):
    """One of the two bodies of a telescopic leg, symmetric about the leg's line."""

    mass: MassOrNone
    com: NonNegativeLength = Field(description="mass centre: distance from the body's own joint")
    transverse: MomentOrNone = Field(description="central moment of inertia across the leg")
    axial: MomentOrNone = Field(description="moment of inertia along the leg")

    _triangle = field_validator("axial")(check_axial)


class Leg(Table):
    """A telescopic leg as a whole."""

    stiffness: Stiffness | None = Field(default=None, description=AXIAL)


def distance(start: tuple[float, ...], end: tuple[float, ...]) -> float:
    return float(np.linalg.norm(np.subtract(end, start)))


def across(body: Rod | LegBody) -> float:
    """Radius of gyration across a body [m]; 0 without mass."""
    return math.sqrt(body.transverse / body.mass) if body.mass else 0.0


def cross(a: Sequence[float] | np.ndarray, b: Sequence[float] | np.ndarray) -> np.ndarray:
    """Cross product of two vectors, (3,): numpy's own takes ten times as long for one."""
    (a0, a1, a2), (b0, b1, b2) = map(float, a), map(float, b)
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])
