"""The mechanism: a frozen, validated description in SI."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, StrictBool, ValidationError, field_validator, model_validator

from ..errors import MechanismError
from .chain import Chain
from .quantities import (
    Interval,
    Name,
    Number,
    Point,
    Positive,
    PositiveLength,
    Table,
    Vector,
)
from .surface import Surface, sides

COORDINATES = ("X", "Y", "Z", "alpha", "beta", "gamma")
Coordinate = Literal["X", "Y", "Z", "alpha", "beta", "gamma"]
Side = Literal["below", "above", "inside", "outside"]
SIDE_OPTIONS = ("side", "ball_radius", "one_sided")


class Inertia(Table):
    """Entries of the inertia tensor about O_M along the axes of {M}, kg m^2."""

    xx: Positive
    yy: Positive
    zz: Positive
    xy: Number = 0.0
    xz: Number = 0.0
    yz: Number = 0.0

    def tensor(self) -> np.ndarray:
        """The symmetric tensor, (3, 3) [kg m^2]."""
        return np.array(
            [
                [self.xx, self.xy, self.xz],
                [self.xy, self.yy, self.yz],
                [self.xz, self.yz, self.zz],
            ]
        )

    @model_validator(mode="after")
    def _physical(self) -> Self:
        smallest, middle, largest = np.linalg.eigvalsh(self.tensor())
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

    mass: Positive
    inertia: Inertia
    points: dict[Name, Point] = Field(default_factory=dict, description="landmarks, in {M}")


class Bounds(Table):
    """Where the surface ends: the ranges of the contact point in {S}."""

    x: Interval | None = None
    y: Interval | None = None
    z: Interval | None = None


class Contact(Table):
    """A platform point (the centre of a condyle ball) that stays on a surface fixed in {S}.

    With `ball_radius` the surface is the wall that the ball touches, and the centre keeps that
    distance from it; with `one_sided` the ball can lift off.
    """

    name: Name
    point: Point = Field(description="centre of the ball, in {M}")
    surface: Surface
    side: Side | None = Field(default=None, description="where the ball is, seen from the surface")
    ball_radius: PositiveLength | None = Field(
        default=None, description="the surface is the wall, and the centre this far from it"
    )
    one_sided: StrictBool = Field(
        default=False, description="the surface can push the ball and not pull it"
    )
    bounds: Bounds = Bounds()

    @model_validator(mode="before")
    @classmethod
    def _options_of_the_surface(cls, data: Any) -> Any:
        """`side` and its two options may stand in the table of the surface too."""
        surface = data.get("surface") if isinstance(data, Mapping) else None
        if not isinstance(surface, Mapping):
            return data
        moved = {key: surface[key] for key in SIDE_OPTIONS if key in surface}
        if twice := sorted(moved.keys() & data.keys()):
            raise ValueError(f"{', '.join(twice)} stands in the contact and in its surface")
        kept = {key: value for key, value in surface.items() if key not in moved}
        return {**data, **moved, "surface": kept}

    @model_validator(mode="after")
    def _sided(self) -> Self:
        known = sides(self.surface.closed)
        kind = self.surface.kind
        article = "an" if kind[0] in "aeiou" else "a"
        expected = f'expected "{known[0]}" or "{known[1]}" for {article} {kind}'
        if self.side is None and (self.ball_radius is not None or self.one_sided):
            raise ValueError(f"side is missing, and ball_radius and one_sided need it: {expected}")
        if self.side is not None and self.side not in known:
            raise ValueError(f'side: {expected}, got "{self.side}"')
        room, ball = getattr(self.surface, "radius", math.inf), self.ball_radius or 0.0
        if self.side == "inside" and ball >= room:
            raise ValueError(
                f"ball_radius: a ball of radius {ball * 1e3:g} mm has no room inside a "
                f"{kind} of radius {room * 1e3:g} mm"
            )
        return self

    @property
    def locus(self) -> Any:
        """The surface on which the centre of the ball stays: parallel to the wall, if it is one."""
        if self.ball_radius is None:
            return self.surface
        return self.surface.parallel(self.push * self.ball_radius, self.point)

    @property
    def push(self) -> int:
        """Sign of a contact force lambda with which the surface pushes the ball; 0 if unknown."""
        return {None: 0, "above": 1, "outside": 1, "below": -1, "inside": -1}[self.side]


class Mechanism(Table):
    """A platform, the contacts that hold it and the chains that drive it.

    All values are SI. Change one with `replace`, write one with `condyle.dump`.
    """

    name: Name
    gravity: Vector = (0.0, 0.0, -9.81)
    dependent: tuple[Coordinate, ...] | None = Field(
        default=None, description="pose coordinates that the contacts determine"
    )
    platform: Platform
    contacts: tuple[Contact, ...] = Field(default=(), alias="contact", max_length=5)
    chains: tuple[Chain, ...] = Field(alias="chain", min_length=1)

    def replace(self, **changes: Any) -> Mechanism:
        """A copy with some fields changed, validated as a file would be.

        Raises: MechanismError: with every problem found.
        """
        from .files import describe

        fields = {name: getattr(self, name) for name in type(self).model_fields}
        try:
            return Mechanism(**(fields | changes))
        except ValidationError as error:
            raise MechanismError(self.name, describe(error, fields | changes)) from None

    @property
    def degrees_of_freedom(self) -> int:
        return 6 - len(self.contacts)

    @cached_property
    def chain_names(self) -> tuple[str, ...]:
        return tuple(chain.name for chain in self.chains)

    @cached_property
    def contact_names(self) -> tuple[str, ...]:
        return tuple(contact.name for contact in self.contacts)

    @field_validator("dependent")
    @classmethod
    def _distinct(cls, value: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if value is not None and len(set(value)) != len(value):
            raise ValueError(f"a coordinate stands twice in {list(value)}")
        return value

    @model_validator(mode="after")
    def _whole(self) -> Self:
        listed = {
            "contact": [{"name": name} for name in self.contact_names],
            "chain": [{"name": name} for name in self.chain_names],
            "dependent": self.dependent,
        }
        if problems := list(structural_problems(listed)):
            raise ValueError("; ".join(problems))
        return self


def structural_problems(data: Mapping[str, Any]) -> Iterable[str]:
    """Problems of the whole that can be seen before its parts are valid.

    Args: data: the file's top level, as TOML gives it.
    """
    counts = {}
    for kind in ("contact", "chain"):
        tables = data.get(kind, ())
        tables = [t for t in tables if isinstance(t, Mapping)] if isinstance(tables, list) else []
        counts[kind] = len(tables)
        names = Counter(t["name"] for t in tables if isinstance(t.get("name"), str))
        for name, count in names.items():
            if count > 1:
                yield f'{kind}: the name "{name}" stands {count} times; every {kind} needs its own'
    freedoms = 6 - counts["contact"]
    if 0 < counts["chain"] < freedoms and freedoms > 0:
        yield (
            f"chain: {counts['chain']} actuators cannot drive {freedoms} degrees of freedom "
            f"(6 less {counts['contact']} contacts); at least {freedoms} chains are needed"
        )
    dependent = data.get("dependent")
    if isinstance(dependent, list | tuple) and len(dependent) != counts["contact"]:
        yield (
            f"dependent: names {len(dependent)} coordinates, but there are {counts['contact']} "
            "contacts; each contact determines one"
        )
