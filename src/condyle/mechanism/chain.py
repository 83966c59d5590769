"""The chains that drive the platform: the data of each family, checked at home.

A family's mathematics is in `condyle.kinematics.chain`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from ..errors import UnsupportedError, join
from .actuator import CableActuator, Limits, LinearActuator, MuscleActuator, RotaryActuator
from .bodies import Crank, Leg, LegBody, Rod, Slider, across, cross, distance
from .kinds import Kinds
from .quantities import (
    Direction,
    Duration,
    Force,
    Limit,
    Name,
    NonNegativeLength,
    Pennation,
    Point,
    PositiveLength,
    Strain,
)
from .table import Table

AXIS_TOLERANCE = math.radians(0.5)  # how far an axis may be off the perpendicular
NO_BRANCH = 1e-9  # sine of the transmission angle below which home has no branch
Links = dict[str, tuple[str, str]]


class ChainTable(Table):
    """What every family has: a name and a joint on the platform.

    links: the ends of its links at home, by the keys of the table; the last leads to the platform.
    rod:   what messages call the last one.
    """

    name: Name

    links: ClassVar[Links] = {}
    rod_name: ClassVar[str] = "rod"

    @property
    def lengths(self) -> dict[str, float]:
        """Lengths of its links at home [m]."""
        return {k: distance(*(getattr(self, end) for end in v)) for k, v in self.links.items()}

    @property
    def masses(self) -> dict[str, float]:
        """Masses of its moving bodies [kg], of those that have one."""
        bodies = {name: b for name, b in self if isinstance(b, Crank | Rod | LegBody | Slider)}
        return {n: b.mass for n, b in bodies.items() if b.mass or not isinstance(b, Crank)}

    @property
    def axial_stiffness(self) -> float | None:
        """The stiffness of its rod or leg along itself [N/m]; None: rigid."""
        found = (
            getattr(body, "stiffness", None) for _, body in self if isinstance(body, Rod | Leg)
        )
        return next(found, None)

    @property
    def rigid(self) -> bool:
        """Whether nothing of it gives under a load."""
        actuator = getattr(self, "actuator", None)
        own = getattr(actuator, "stiffness", None), self.axial_stiffness
        return own == (None, None) and not hasattr(self, "muscle")

    @property
    def radii_of_gyration(self) -> dict[str, float]:
        """Radii of gyration of its bodies across themselves [m], by the link they belong to."""
        radii = [across(body) for _, body in self if isinstance(body, Rod | LegBody)]
        return {list(self.links)[-1]: max(radii)} if radii else {}

    @property
    def fixed_points(self) -> tuple[tuple[float, ...], ...]:
        """Where it is at home, in {S} [m]; its joint on the platform apart."""
        return tuple(getattr(self, start) for start, _ in self.links.values())

    @field_validator("platform", check_fields=False)
    @classmethod
    def _last_link(cls, joint: Any, info: ValidationInfo) -> Any:
        start = list(cls.links.values())[-1][0]
        if (point := info.data.get(start)) is not None:
            rod = np.subtract(joint, point)
            if not np.linalg.norm(rod):
                raise ValueError(
                    f"the {cls.rod_name} has zero length: {start} and platform are the same point"
                )
            cls._at_home(rod, info.data)
        return joint

    @classmethod
    def _at_home(cls, rod: np.ndarray, data: Mapping[str, Any]) -> None:
        """Refuses a chain whose home has no branch; `rod` is its last link."""


class RSS(ChainTable):
    """A crank on a base-mounted shaft, and a coupler with two ball joints ([Cheng2023] Fig. 1)."""

    kind: Literal["RSS"]
    base: Point = Field(description="crank pivot G, in {S}")
    axis: Direction = Field(description="shaft direction Z_C, in {S}")
    crank_tip: Point = Field(description="crank tip S at home, in {S}")
    platform: Point = Field(description="platform joint M, in {M}")
    crank: Crank
    coupler: Rod
    actuator: RotaryActuator = RotaryActuator()

    links: ClassVar[Links] = {"crank": ("base", "crank_tip"), "coupler": ("crank_tip", "platform")}
    rod_name = "coupler"

    @field_validator("crank_tip")
    @classmethod
    def _crank(cls, tip: Any, info: ValidationInfo) -> Any:
        base, axis = info.data.get("base"), info.data.get("axis")
        if base is None:
            return tip
        crank = np.subtract(tip, base)
        if not np.linalg.norm(crank):
            raise ValueError("the crank has zero length: base and crank_tip are the same point")
        if axis is not None:
            off = math.asin(min(_sine(axis, crank), 1.0))
            if off > AXIS_TOLERANCE:
                raise ValueError(
                    f"axis is {math.degrees(off):.2f} degrees off the perpendicular to the crank "
                    "(base to crank_tip); at most 0.5 are projected away"
                )
        return tip

    @classmethod
    def _at_home(cls, rod: np.ndarray, data: Mapping[str, Any]) -> None:
        base, axis = data.get("base"), data.get("axis")
        if base is not None and axis is not None:
            tangent = cross(axis, np.subtract(data["crank_tip"], base))
            if _sine(rod, tangent) < NO_BRANCH:
                raise ValueError(
                    "crank and coupler are in line at home: there the crank has no branch, and "
                    "its torque no hold on the platform; move crank_tip or platform"
                )


class PSS(ChainTable):
    """A slider on a rail fixed in the base, and a rod with two ball joints; also called PUS."""

    kind: Literal["PSS"]
    base: Point = Field(description="the slider's joint S at home, in {S}")
    axis: Direction = Field(description="rail direction, in {S}")
    platform: Point = Field(description="platform joint M, in {M}")
    slider: Slider
    rod: Rod
    actuator: LinearActuator = LinearActuator()

    links: ClassVar[Links] = {"rod": ("base", "platform")}

    @classmethod
    def _at_home(cls, rod: np.ndarray, data: Mapping[str, Any]) -> None:
        axis = data.get("axis")
        if axis is not None and _sine(rod, axis) < NO_BRANCH:
            raise ValueError(
                "the rod is perpendicular to the rail at home: there the slider has no "
                "branch, and its force no hold on the platform; move base or platform"
            )


class SPS(ChainTable):
    """A telescopic leg, cylinder and piston, between two ball joints; also called UPS."""

    kind: Literal["SPS"]
    base: Point = Field(description="base joint B, in {S}")
    platform: Point = Field(description="platform joint M, in {M}")
    cylinder: LegBody = Field(description="the body at B")
    piston: LegBody = Field(description="the body at M")
    leg: Leg = Leg()
    actuator: LinearActuator = LinearActuator()

    links: ClassVar[Links] = {"leg": ("base", "platform")}
    rod_name = "leg"


class Cable(ChainTable):
    """A straight massless line between two points that can only pull: a tendon, a muscle."""

    kind: Literal["cable"]
    base: Point = Field(description="where it is held or wound up, B, in {S}")
    platform: Point = Field(description="where it holds the platform, M, in {M}")
    actuator: CableActuator = CableActuator()

    links: ClassVar[Links] = {"line": ("base", "platform")}
    rod_name = "cable"

    @property
    def anchor(self) -> tuple[float, float, float]:
        """The point in {S} from which the line runs straight to M [m]."""
        return self.base

    @model_validator(mode="before")
    @classmethod
    def _no_bodies(cls, data: Any) -> Any:
        """All keys of other families in one line, since what is meant is another family."""
        known = {key for family in (RSS, PSS, SPS) for key in family.model_fields}
        foreign = known - cls.model_fields.keys()
        if isinstance(data, Mapping) and (found := [key for key in data if key in foreign]):
            raise ValueError(
                f"a {cls.rod_name} is a massless line from base to platform and has no "
                f"{', '.join(found)}; remove what it has not, or name the kind of chain that has "
                "it (RSS, PSS, SPS)"
            )
        return data


class Fibres(Table):
    """The numbers of a muscle; its curves are in `condyle.kinematics.chain.muscle`."""

    implied: ClassVar[tuple[str, ...]] = (
        "pennation",
        "max_speed",
        "passive_strain",
        "activation_time",
        "deactivation_time",
    )

    max_force: Force = Field(description="isometric, at optimal length, fully active")
    optimal_length: PositiveLength = Field(description="of the fibres")
    tendon_length: NonNegativeLength = Field(description="slack length; the tendon is rigid")
    pennation: Pennation = Field(
        default=0.0, description="at optimal length; the thickness is constant"
    )
    max_speed: Limit = Field(default=10.0, description="optimal lengths a second")
    passive_strain: Strain = Field(
        default=0.6,
        description="strain of the fibres at which passive force is max_force; 0: no passive force",
    )
    activation_time: Duration = Field(default=0.015, description="time constant of rising")
    deactivation_time: Duration = Field(default=0.060, description="time constant of falling")


class Muscle(Cable):
    """A cable whose limits follow from its length and speed."""

    kind: Literal["muscle"]  # type: ignore[assignment]
    base: Point = Field(description="origin, in {S}")
    platform: Point = Field(description="insertion, in {M}")
    via: tuple[Point, ...] = Field(
        default=(), description="points in {S} that the line passes, in order, base to platform"
    )
    muscle: Fibres
    actuator: MuscleActuator = MuscleActuator()  # type: ignore[assignment]

    rod_name = "muscle"
    implied: ClassVar[tuple[str, ...]] = ("via",)

    @property
    def anchor(self) -> tuple[float, float, float]:
        return (self.base, *self.via)[-1]

    @property
    def fixed_points(self) -> tuple[tuple[float, ...], ...]:
        return self.base, *self.via

    @property
    def lengths(self) -> dict[str, float]:
        points = (self.base, *self.via, self.platform)
        return {"line": sum(distance(a, b) for a, b in pairwise(points))}

    @field_validator("via")
    @classmethod
    def _passes(cls, via: Any, info: ValidationInfo) -> Any:
        ends = (info.data.get("base"), *via, info.data.get("platform"))
        if via and any(a == b for a, b in pairwise(ends)):
            raise ValueError("two points of the line in a row are the same; remove one of them")
        return via


CHAINS = Kinds[ChainTable]("condyle.chains", RSS, PSS, SPS, Cable, Muscle)
Chain = Annotated[Any, CHAINS]


def _sine(a: Any, b: Any) -> float:
    """|a . b| over their lengths: sine of the angle by which they are off the perpendicular."""
    return float(abs(np.dot(a, b)) / (np.linalg.norm(a) * np.linalg.norm(b)))


def limits(chain: Any) -> Limits:
    """Limits of a chain's actuator, whatever its effort is called in the file.

    Those of a muscle's tension follow from its length and speed: see
    `condyle.kinematics.chain.muscle.tension`.
    """
    speed = chain.actuator.speed_limit
    low, high = chain.actuator.effort_range
    return Limits(low, high, math.inf if speed is None else speed)


def require_fixed_limits(chains: Iterable[Chain], what: str, walls: Sequence[Any] = ()) -> None:
    """Raises UnsupportedError where limits follow from the state; `what` needs them fixed.

    Args: walls: that can bear a force near them.
    """
    if walls:
        raise UnsupportedError(
            f"{what}: whether walls bear a force follows from the state. Walls are "
            f"{join(wall.name for wall in walls)}: set their enabled to false"
        )
    muscles = [chain.name for chain in chains if chain.kind == "muscle"]
    if muscles:
        raise UnsupportedError(
            f"{what}: limits of muscles follow from their length and speed, and here limits are "
            f"fixed numbers. Muscles are {join(muscles)}: take the same lines as cables with a "
            "force_limit"
        )
