"""The chains that drive the platform: the data of each family, checked at home.

A family's mathematics is in `condyle.kinematics.chain`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from .actuator import CableActuator, Limits, LinearActuator, RotaryActuator
from .bodies import Crank, LegBody, Rod, Slider, across, check_rod_length, cross, distance
from .quantities import Direction, Name, Point
from .table import Table

AXIS_TOLERANCE = math.radians(0.5)  # how far an axis may be off the perpendicular
NO_BRANCH = 1e-9  # sine of the transmission angle below which home has no branch


class ChainTable(Table):
    """What every family has: a name and a joint on the platform."""

    name: Name

    @property
    def lengths(self) -> dict[str, float]:
        """Of its links at home [m]."""
        return {}

    @property
    def masses(self) -> dict[str, float]:
        """Of its moving bodies [kg], those that have one."""
        return {}

    @property
    def radii_of_gyration(self) -> dict[str, float]:
        """Radii of gyration of its bodies across themselves [m], by the link they belong to."""
        return {}

    @property
    def fixed_points(self) -> tuple[tuple[float, ...], ...]:
        """Where it is at home, in {S} [m]; its joint on the platform apart."""
        return ()


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

    @property
    def lengths(self) -> dict[str, float]:
        crank, coupler = (self.base, self.crank_tip), (self.crank_tip, self.platform)
        return {"crank": distance(*crank), "coupler": distance(*coupler)}

    @property
    def masses(self) -> dict[str, float]:
        return {"coupler": self.coupler.mass}

    @property
    def radii_of_gyration(self) -> dict[str, float]:
        return {"coupler": across(self.coupler)}

    @property
    def fixed_points(self) -> tuple[tuple[float, ...], ...]:
        return self.base, self.crank_tip

    @field_validator("crank_tip")
    @classmethod
    def _crank(cls, tip: Any, info: ValidationInfo) -> Any:
        base, axis = info.data.get("base"), info.data.get("axis")
        if base is None:
            return tip
        crank = np.subtract(tip, base)
        if not (length := np.linalg.norm(crank)):
            raise ValueError("the crank has zero length: base and crank_tip are the same point")
        if axis is not None:
            sine = abs(np.dot(axis, crank)) / (np.linalg.norm(axis) * length)
            off = math.asin(min(sine, 1.0))
            if off > AXIS_TOLERANCE:
                raise ValueError(
                    f"axis is {math.degrees(off):.2f} degrees off the perpendicular to the crank "
                    "(base to crank_tip); at most 0.5 are projected away"
                )
        return tip

    @field_validator("platform")
    @classmethod
    def _coupler(cls, joint: Any, info: ValidationInfo) -> Any:
        data = info.data
        tip, base, axis = data.get("crank_tip"), data.get("base"), data.get("axis")
        if tip is None:
            return joint
        coupler = np.subtract(joint, tip)
        check_rod_length(coupler, "coupler", "crank_tip")
        if base is not None and axis is not None:
            tangent = cross(axis, np.subtract(tip, base))
            sine = abs(coupler @ tangent) / (np.linalg.norm(coupler) * np.linalg.norm(tangent))
            if sine < NO_BRANCH:
                raise ValueError(
                    "crank and coupler are in line at home: there the crank has no branch, and "
                    "its torque no hold on the platform; move crank_tip or platform"
                )
        return joint


class PSS(ChainTable):
    """A slider on a rail fixed in the base, and a rod with two ball joints; also called PUS."""

    kind: Literal["PSS"]
    base: Point = Field(description="the slider's joint S at home, in {S}")
    axis: Direction = Field(description="rail direction, in {S}")
    platform: Point = Field(description="platform joint M, in {M}")
    slider: Slider
    rod: Rod
    actuator: LinearActuator = LinearActuator()

    @property
    def lengths(self) -> dict[str, float]:
        return {"rod": distance(self.base, self.platform)}

    @property
    def masses(self) -> dict[str, float]:
        return {"slider": self.slider.mass, "rod": self.rod.mass}

    @property
    def radii_of_gyration(self) -> dict[str, float]:
        return {"rod": across(self.rod)}

    @property
    def fixed_points(self) -> tuple[tuple[float, ...], ...]:
        return (self.base,)

    @field_validator("platform")
    @classmethod
    def _rod(cls, joint: Any, info: ValidationInfo) -> Any:
        base, axis = info.data.get("base"), info.data.get("axis")
        if base is None:
            return joint
        rod = np.subtract(joint, base)
        check_rod_length(rod, "rod", "base")
        if axis is not None:
            sine = abs(np.dot(axis, rod)) / (np.linalg.norm(axis) * np.linalg.norm(rod))
            if sine < NO_BRANCH:
                raise ValueError(
                    "the rod is perpendicular to the rail at home: there the slider has no "
                    "branch, and its force no hold on the platform; move base or platform"
                )
        return joint


class SPS(ChainTable):
    """A telescopic leg, cylinder and piston, between two ball joints; also called UPS."""

    kind: Literal["SPS"]
    base: Point = Field(description="base joint B, in {S}")
    platform: Point = Field(description="platform joint M, in {M}")
    cylinder: LegBody = Field(description="the body at B")
    piston: LegBody = Field(description="the body at M")
    actuator: LinearActuator = LinearActuator()

    @property
    def lengths(self) -> dict[str, float]:
        return {"leg": distance(self.base, self.platform)}

    @property
    def masses(self) -> dict[str, float]:
        return {"cylinder": self.cylinder.mass, "piston": self.piston.mass}

    @property
    def radii_of_gyration(self) -> dict[str, float]:
        return {"leg": max(across(self.cylinder), across(self.piston))}

    @property
    def fixed_points(self) -> tuple[tuple[float, ...], ...]:
        return (self.base,)

    @field_validator("platform")
    @classmethod
    def _leg(cls, joint: Any, info: ValidationInfo) -> Any:
        if (base := info.data.get("base")) is not None:
            check_rod_length(np.subtract(joint, base), "leg", "base")
        return joint


class Cable(ChainTable):
    """A straight massless line between two points that can only pull: a tendon, a muscle."""

    kind: Literal["cable"]
    base: Point = Field(description="where it is held or wound up, B, in {S}")
    platform: Point = Field(description="where it holds the platform, M, in {M}")
    actuator: CableActuator = CableActuator()

    @property
    def lengths(self) -> dict[str, float]:
        return {"line": distance(self.base, self.platform)}

    @property
    def fixed_points(self) -> tuple[tuple[float, ...], ...]:
        return (self.base,)

    @model_validator(mode="before")
    @classmethod
    def _no_bodies(cls, data: Any) -> Any:
        """All keys of other families in one line, since what is meant is another family."""
        known = {key for family in (RSS, PSS, SPS) for key in family.model_fields}
        foreign = known - cls.model_fields.keys()
        if isinstance(data, Mapping) and (found := [key for key in data if key in foreign]):
            raise ValueError(
                f"a cable is a massless line from base to platform and has no {', '.join(found)}; "
                "remove what it has not, or name the kind of chain that has it (RSS, PSS, SPS)"
            )
        return data

    @field_validator("platform")
    @classmethod
    def _line(cls, joint: Any, info: ValidationInfo) -> Any:
        if (base := info.data.get("base")) is not None:
            check_rod_length(np.subtract(joint, base), "cable", "base")
        return joint


Chain = Annotated[RSS | PSS | SPS | Cable, Field(discriminator="kind")]


def limits(chain: RSS | PSS | SPS | Cable) -> Limits:
    """Limits of a chain's actuator, whatever its effort is called in the file."""
    speed = chain.actuator.speed_limit
    return Limits(*chain.actuator.effort_range, math.inf if speed is None else speed)
