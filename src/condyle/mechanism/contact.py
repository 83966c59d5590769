"""A point contact: a ball of the platform on a surface of the base."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal, Self

import casadi as ca
import numpy as np
from pydantic import BeforeValidator, Field, StrictBool, model_validator

from .actuator import SMOOTHING_SPEED
from .compliance import ContactCompliance
from .quantities import (
    Coefficient,
    Interval,
    Name,
    NonNegativeLength,
    Point,
    PositiveLength,
    Restitution,
    SlidingSpeed,
)
from .surface import Surface, of_form, parallel, sides
from .table import Table
from .table_schema import SIDE_OPTIONS

Side = Literal["below", "above", "inside", "outside"]


class Bounds(Table):
    """Where the surface ends: the ranges of the contact point in {S}."""

    x: Interval | None = None
    y: Interval | None = None
    z: Interval | None = None


class Friction(Table):
    """Coulomb friction where the ball touches the surface, smooth through rest.

    The surface puts -coefficient |lambda| v / sqrt(|v|^2 + smoothing_speed^2) on the platform, with
    v the velocity of the platform's material point there.
    """

    implied: ClassVar[tuple[str, ...]] = ("smoothing_speed",)

    coefficient: Coefficient
    static_coefficient: Coefficient | None = Field(
        default=None, description="of a contact at rest, in simulations; without it none sticks"
    )
    smoothing_speed: SlidingSpeed = Field(
        default=SMOOTHING_SPEED, description="below it friction fades"
    )

    @model_validator(mode="after")
    def _static_is_no_less(self) -> Self:
        static = self.static_coefficient
        if static is not None and not 0 < self.coefficient <= static:
            raise ValueError(
                f"static_coefficient: expected no less than a coefficient above 0, got {static:g} "
                f"and {self.coefficient:g}"
            )
        return self


FRICTIONLESS = Friction(coefficient=0.0)


def _none_is_frictionless(value: Any) -> Any:
    return FRICTIONLESS if value is None else value


class Contact(Table):
    """A platform point (the centre of a condyle ball) that stays on a surface fixed in {S}.

    With `ball_radius` the surface is the wall that the ball touches, and the centre keeps that
    distance from it; a `one_sided` contact is unilateral: it can be lost.
    """

    implied: ClassVar[tuple[str, ...]] = ("friction", "restitution", "clearance")

    name: Name
    point: Point = Field(description="centre of the ball, in {M}")
    surface: Surface
    side: Side | None = Field(default=None, description="where the ball is, seen from the surface")
    ball_radius: PositiveLength | None = Field(
        default=None, description="the surface is the wall, and the centre this far from it"
    )
    one_sided: StrictBool = Field(
        default=False, description="unilateral contact: the surface can push the ball, not pull it"
    )
    bounds: Bounds = Bounds()
    restitution: Restitution = Field(
        default=0.0, description="of rigid landings: normal speed after over that before"
    )
    clearance: NonNegativeLength = Field(
        default=0.0,
        description="free play of a two-sided contact to either side, in simulations in which "
        "contacts lift",
    )
    friction: Annotated[Friction, BeforeValidator(_none_is_frictionless)] = FRICTIONLESS
    compliance: ContactCompliance | None = Field(
        default=None, description="how it gives under its force, for indentation and pressure"
    )

    @model_validator(mode="before")
    @classmethod
    def _options_of_the_surface(cls, data: Any) -> Any:
        """`side` and its two options may stand in the table of the surface too."""
        surface = data.get("surface") if isinstance(data, Mapping) else None
        if not isinstance(surface, Mapping):
            return data
        moved = {key: surface[key] for key in SIDE_OPTIONS if key in surface}
        if twice := sorted(moved.keys() & data.keys()):
            raise ValueError(
                f"{', '.join(twice)} is given twice: in [[contact]] and in its surface"
            )
        kept = {key: value for key, value in surface.items() if key not in moved}
        return {**data, **moved, "surface": kept}

    @model_validator(mode="after")
    def _sided(self) -> Self:
        if self.one_sided and self.clearance:
            raise ValueError("clearance is of a two-sided contact; remove it, or one_sided")
        known = sides(self.surface.closed)
        kind = self.surface.kind
        article = "an" if kind[0] in "aeiou" else "a"
        expected = f'expected "{known[0]}" or "{known[1]}" for {article} {kind}'
        if self.side is None and (self.ball_radius is not None or self.one_sided):
            raise ValueError(f"side is missing, and ball_radius and one_sided need it: {expected}")
        if self.side is not None and self.side not in known:
            raise ValueError(f'side: {expected}, got "{self.side}"')
        room, ball = self.surface.room(self.surface), self.ball_radius or 0.0
        if self.side == "inside" and room is not None and ball >= room:
            raise ValueError(
                f"ball_radius: a ball of radius {ball * 1e3:g} mm has no room inside a "
                f"{kind} of radius {room * 1e3:g} mm"
            )
        if room is not None and self.clearance >= room + self.push * ball:
            raise ValueError(
                f"clearance: expected less than {(room + self.push * ball) * 1e3:g} mm, the radius "
                f"of the {kind} on which the ball's centre is, got {self.clearance * 1e3:g} mm"
            )
        law = self.compliance
        if law is not None and law.curved and law.radius is None and self.ball_radius is None:
            raise ValueError(
                f"compliance: radius is missing: {law.kind} needs the ball's, here or as the "
                "contact's ball_radius"
            )
        return self

    @property
    def offset_surface(self) -> Any:
        """The surface on which the centre of the ball stays: parallel to the wall, if it is one."""
        if self.ball_radius is None:
            return self.surface
        return parallel(self.surface, self.push * self.ball_radius, self.point)

    @property
    def faces(self) -> tuple[tuple[int, Any], ...]:
        """What the ball may lift from: for each face the sign with which it pushes, and the surface
        on which the ball's centre is where they touch. Two with `clearance`, none of a contact that
        always holds."""
        if self.one_sided:
            return ((self.push, self.offset_surface),)
        if not self.clearance:
            return ()
        middle = self.push * (self.ball_radius or 0.0)
        return tuple(
            (sign, parallel(self.surface, middle - sign * self.clearance, self.point))
            for sign in (1, -1)
        )

    def gap(self, at: np.ndarray) -> float:
        """How far a ball centred there, (3,) [m] in {S}, is from its nearest face, to first order;
        negative where they overlap."""
        distance = self.distance(at)
        return min(self.clearance + sign * distance for sign, _ in self.faces)

    def gradient(self, at: np.ndarray | None = None) -> tuple[float, np.ndarray]:
        """phi [m] and its gradient, (3,) [1], of the ball's centre in {S}, by default at home."""
        locus = self.offset_surface
        centre = self.point if at is None else tuple(map(float, at))
        value, *gradient = _at(locus.form, (*centre, *locus.constants()))
        return value, np.array(gradient)

    def distance(self, at: np.ndarray) -> float:
        """phi over the size of its gradient [m], to first order the ball's distance."""
        value, gradient = self.gradient(at)
        return value / float(np.linalg.norm(gradient))

    @property
    def touching_point(self) -> tuple[float, ...]:
        """Where the ball touches the surface at home, (3,) [m] in {S}; without a ball its point."""
        if self.ball_radius is None:
            return self.point
        _, n = self.gradient()
        away = self.push * self.ball_radius * n / np.linalg.norm(n)
        return tuple(map(float, np.subtract(self.point, away)))

    @property
    def ends(self) -> tuple[tuple[float, float], ...]:
        """Low and high x, y and z of the surface [m], infinite without bounds.

        Bounds that home is outside of do not count: the surface goes on there.
        """
        every = (-math.inf, math.inf)
        found = tuple(own or every for own in self.bounds.entries().values())
        ends = zip(found, self.touching_point, strict=True)
        return found if all(low <= x <= high for (low, high), x in ends) else (every,) * 3

    @property
    def push(self) -> int:
        """Sign of a contact force lambda with which the surface pushes the ball; 0 if unknown."""
        return {None: 0, "above": 1, "outside": 1, "below": -1, "inside": -1}[self.side]


@lru_cache(maxsize=256)
def _at(form: str, numbers: tuple[float, ...]) -> tuple[float, ...]:
    """phi and the entries of its gradient, from a point and the constants of a surface."""
    return tuple(map(float, _equation(form, len(numbers) - 3)(*numbers)))


@lru_cache(maxsize=256)
def _equation(form: str, count: int) -> ca.Function:
    """phi and the entries of its gradient, from the entries of a point and `count` constants."""
    p, c = ca.SX.sym("p", 3), ca.SX.sym("c", count)
    phi = of_form(form).phi(p, c)
    found = [phi, *ca.vertsplit(ca.gradient(phi, p))]
    return ca.Function("phi", [*ca.vertsplit(p), *ca.vertsplit(c)], found)
