"""The actuator of a chain: its limits, inertia and friction.

Effort is what the actuator delivers at its joint,

    effort = tau + rotor_inertia gear^2 theta'' + viscous theta'
             + coulomb theta' / sqrt(theta'^2 + smoothing_speed^2),

with tau what the mechanism takes. Its encoder reads joint + zero.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from ..errors import InputError
from .quantities import (
    Angle,
    EffortLimit,
    Gear,
    JointDamping,
    JointFriction,
    JointSpeed,
    JointStiffness,
    Length,
    MomentOrNone,
    PullLimit,
    SpeedLimit,
)
from .table import Table

READS = "what the encoder reads at home"
SMOOTHING_SPEED = 1e-3  # rad/s or m/s: default speed below which Coulomb friction fades


class Limits(NamedTuple):
    """Limits of an actuator: low <= effort <= high, |rate| <= speed; infinite where none is given.

    low, high: [N m or N];  speed: [rad/s or m/s].
    """

    low: float
    high: float
    speed: float

    @property
    def limited(self) -> bool:
        """Whether the effort has a limit at all."""
        return math.isfinite(self.low) or math.isfinite(self.high)

    @property
    def symmetric(self) -> bool:
        """Whether the effort has one limit for both directions."""
        return self.low == -self.high

    def part(self, share: float) -> Limits:
        """Limits of which only a share is used: what lies between them shrinks, never grows.

        The greatest effort, the opposite one of an actuator that pushes and pulls and the speed are
        multiplied. A least effort above zero, such as a cable's, stays; so does its opposite.

        Raises: InputError: where nothing is left between them.
        """
        low = self.low * share if self.low < 0 else self.low
        high = self.high * share if self.high > 0 else self.high
        if low > high:
            raise InputError(
                f"a share of {share:g} leaves no effort within limits of {self.low:g} to "
                f"{self.high:g}: it multiplies only the limit farther from zero; raise it"
            )
        return Limits(low, high, self.speed * share)

    @property
    def of_speed(self) -> Limits:
        """The limit of the speed in the place of those of the effort, to show both alike."""
        return Limits(-self.speed, self.speed, self.speed)

    @property
    def greatest(self) -> float:
        """The larger of |limits| of the effort, which activations are measured by."""
        return max(abs(self.low), abs(self.high))

    def beyond(self, effort: np.ndarray) -> np.ndarray:
        """Whether efforts are outside the limits, of their shape."""
        return (effort > self.high) | (effort < self.low)

    def use(self, effort: float) -> float | None:
        """Effort over the limit on its side; None where there is none, inf beyond a limit of 0."""
        bound = self.high if effort >= 0 else self.low
        if bound == 0:
            return math.inf if effort else 0.0
        return effort / bound if math.isfinite(bound) and effort / bound >= 0 else None

    def used(self, effort: np.ndarray) -> np.ndarray:
        """Efforts over the limit on their side, of their shape; NaN where there is none.

        Above 1 beyond it. Below a least effort above zero it is that limit over the effort, and
        infinite at efforts of the other side.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            side = np.where(effort >= 0, self.high, self.low)
            share = np.where(np.isfinite(side) & (side != 0), effort / side, np.nan)
            share = np.where((side == 0) & (effort != 0), np.inf, share)
            for end, sign in ((self.low, 1), (self.high, -1)):
                if sign * end > 0:
                    short = np.where(sign * effort > 0, end / effort, np.inf)
                    share = np.where(sign * effort < sign * end, short, share)
        return share

    def effort_text(self, unit: str, scale: float = 1.0, digits: int = 6) -> str:
        """'±3 N m', '0 to 190.4 N', 'at least 0 N'; empty where there is no limit."""
        low, high = (f"{v * scale:.{digits}g}" for v in (self.low, self.high))
        if not self.limited:
            return ""
        if self.symmetric:
            return f"±{high} {unit}"
        if not math.isfinite(self.high):
            return f"at least {low} {unit}"
        if not math.isfinite(self.low):
            return f"at most {high} {unit}"
        return f"{low} to {high} {unit}"


class Actuator(Table):
    """An actuator. Its motor is fixed to the base, not carried by the chain."""

    implied: ClassVar[tuple[str, ...]] = (
        "rotor_inertia",
        "gear",
        "viscous",
        "coulomb",
        "smoothing_speed",
        "damping",
        "zero",
    )

    speed_limit: SpeedLimit | None = None
    rotor_inertia: MomentOrNone = Field(default=0.0, description="of the motor about its own axis")
    gear: Gear = Field(default=1.0, description="turns of the motor a turn of the joint")
    viscous: JointDamping = Field(default=0.0, description="at the joint")
    coulomb: JointFriction = Field(default=0.0, description="at the joint")
    smoothing_speed: JointSpeed = Field(
        default=SMOOTHING_SPEED, description="below it Coulomb friction fades"
    )
    stiffness: JointStiffness | None = Field(
        default=None, description="of servo or shaft, for small deflections; without it rigid"
    )
    damping: JointDamping = Field(default=0.0, description="of that deflection's rate")

    @property
    def effort_range(self) -> tuple[float, float]:
        """Least and greatest effort [N m or N], infinite where there is no limit."""
        limit = getattr(self, "torque_limit", None) or getattr(self, "force_limit", None)
        if limit is None:
            return -math.inf, math.inf
        return limit if isinstance(limit, tuple) else (-limit, limit)

    @property
    def reflected_inertia(self) -> float:
        """rotor_inertia gear^2 [kg m^2 or kg]: inertia of the rotor at the joint."""
        return self.rotor_inertia * self.gear**2

    @property
    def ideal(self) -> bool:
        """Whether the actuator has neither inertia nor friction of its own."""
        return not (self.rotor_inertia or self.viscous or self.coulomb)


class RotaryActuator(Actuator):
    torque_limit: EffortLimit | None = Field(
        default=None, description="N m: |effort| is at most this, or [least, greatest]"
    )
    zero: Angle = Field(default=0.0, description=READS)


class LinearActuator(Actuator):
    force_limit: EffortLimit | None = Field(
        default=None, description="N: |effort| is at most this, or [least, greatest]"
    )
    zero: Length = Field(default=0.0, description=READS)


class MuscleActuator(Actuator):
    """The actuator of a muscle: limits follow from its length and speed, not from a number here."""

    zero: Length = Field(default=0.0, description=READS)

    @property
    def effort_range(self) -> tuple[float, float]:
        return 0.0, math.inf


class CableActuator(Actuator):
    """A winch: it can only pull."""

    force_limit: PullLimit | None = Field(
        default=None, description="N: the greatest tension, or [least, greatest]"
    )
    zero: Length = Field(default=0.0, description=READS)

    @property
    def effort_range(self) -> tuple[float, float]:
        low, high = super().effort_range
        return max(low, 0.0), high
