"""What results derive from an evaluation: each piece once, and only where it is asked for.

The equations of quantities stand here by name; what an evaluation has already is found in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np

from ..kinematics.causes import causes
from ..kinematics.chain.muscle import MuscleState, muscles
from ..mechanism.chain import limits
from ..mechanism.compliance import ContactPatch
from ..mechanism.mechanism import Mechanism
from ..model.contact_patches import compliant, contact_patches
from ..model.passive_forces import PassiveForces
from ..motion.gravity_and_base import Given
from ..quantities import Quantity
from ..status import Status
from .contacts import bound_margins, contact_loss


@dataclass(frozen=True)
class Derived:
    """An evaluation of N samples, flat, and what follows from it.

    wrench:  (N, 6), load on the platform [N, N m], where that is known.
    limited: whether efforts were chosen within limits.
    given:   gravity, (N, 3), and the base's motion, (N, 9), where samples give them.
    simulated: what only a simulation has, by the names of its quantities.
    """

    mechanism: Mechanism
    evaluation: Any
    wrench: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))
    limited: bool = False
    simulated: Mapping[str, np.ndarray] = field(default_factory=dict)
    given: Given = field(default_factory=Given)

    def has(self, quantity: Quantity) -> bool:
        """Whether a solution has it."""
        if quantity.simulated:
            return quantity.name in self.simulated
        if quantity.where == "computed":
            return hasattr(self.evaluation, quantity.name)
        return CONDITIONS[quantity.where](self)

    def values(self, quantity: Quantity) -> np.ndarray:
        """Its values; floating-point ones of failed samples may be anything."""
        if quantity.simulated:
            return self.simulated[quantity.name]
        if callable(equation := quantity.equation):
            return equation(self)
        if equation:
            return attrgetter(equation)(self)
        holder: Any = self
        for inner in ("evaluation", "configuration", "singularity"):
            if hasattr(holder, quantity.name):
                break
            holder = getattr(holder, inner)
        return getattr(holder, quantity.name)

    def filled(self, quantity: Quantity) -> np.ndarray:
        """Its values; NaN where failed samples lack what it needs."""
        values = self.values(quantity)
        if values.dtype.kind == "f" and not (self.all_ok or not quantity.needs):
            values, lost = values.copy(), ~quantity.known(self.evaluation.status)
            values[(slice(None),) * quantity.dims.index("time") + (lost,)] = np.nan
        return values

    @cached_property
    def ok(self) -> np.ndarray:
        return self.evaluation.status == Status.ok

    @cached_property
    def status(self) -> np.ndarray:
        """The samples' `Status`, (N,) int8."""
        return self.evaluation.status.astype(np.int8, copy=False)

    @cached_property
    def all_ok(self) -> bool:
        return bool(self.ok.all())

    @cached_property
    def cause(self) -> np.ndarray:
        """Index into `owners` of what each sample fails by, (N,)."""
        return np.zeros(len(self.ok), np.int16) if self.all_ok else causes(self.evaluation)

    @cached_property
    def bound_margin(self) -> np.ndarray:
        """Distance of contact points to their nearest bound, (N, k) [m]; inf without one."""
        return bound_margins(self.mechanism, self.evaluation.configuration.contact_point)

    @cached_property
    def contact_loss(self) -> np.ndarray:
        """Whether a unilateral contact would have to pull, (N, k): never within limits."""
        if self.limited:  # they push, to the accuracy of the certificate
            return np.zeros(self.evaluation.contact_force.shape, dtype=bool)
        lost = contact_loss(self.mechanism, self.evaluation.contact_force)
        return lost if self.all_ok else lost & self.ok[:, None]

    @cached_property
    def share(self) -> np.ndarray:
        """The shares of efforts that each part needs, (parts, N, n)."""
        return np.moveaxis(self.evaluation.share, 1, 0)

    @cached_property
    def sliding_speed(self) -> np.ndarray:
        """The speed of the platform where it touches, (N, k) [m/s]."""
        return np.linalg.norm(self.evaluation.slip, axis=2)

    @cached_property
    def friction_power(self) -> np.ndarray:
        """Power of friction on the platform, (N, k) [W]; never positive."""
        return np.einsum("nki,nki->nk", self.evaluation.friction_force, self.evaluation.slip)

    @cached_property
    def actuator_power(self) -> np.ndarray:
        """Power that actuators deliver, (N, n) [W]."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.evaluation.effort * self.evaluation.joint_rate

    @cached_property
    def activation(self) -> np.ndarray:
        """Effort over greatest |limit|, (N, n); NaN where there is no limit to measure it by.

        Of a muscle (tension - passive force) over the active force at its length and speed; 0 where
        it is slack.
        """
        greatest = np.array([limits(chain).greatest for chain in self.mechanism.chains])
        measured = np.isfinite(greatest) & (greatest > 0)
        activation = self.evaluation.effort / np.where(measured, greatest, np.nan)
        if driven := muscles(self.mechanism.chains):
            passive, active = self.muscle.passive[:, driven], self.muscle.active[:, driven]
            tension = self.evaluation.effort[:, driven] - passive
            with np.errstate(divide="ignore", invalid="ignore"):
                activation[:, driven] = np.where(active > 0, tension / active, 0.0)
        return activation

    @cached_property
    def muscle(self) -> MuscleState:
        """Fibres of muscles, with their limits."""
        e = self.evaluation
        return MuscleState.of(self.mechanism.chains, e.configuration.joint, e.joint_rate)

    @cached_property
    def passive(self) -> PassiveForces:
        """The forces of ligaments and walls."""
        e = self.evaluation
        return PassiveForces.of(self.mechanism, e.pose, e.pose_rate)

    @cached_property
    def contact_patch(self) -> ContactPatch:
        """Indentation, area and pressure of the contacts under their forces."""
        e = self.evaluation
        return contact_patches(self.mechanism, e.pose, getattr(e, "elastic_force", e.contact_force))

    @property
    def wall_force(self) -> np.ndarray:
        """The forces of enabled walls, (N, W) [N]; in a simulation as they acted."""
        acted = self.simulated.get("wall_force")
        return self.evaluation.wall_force if acted is None else acted

    @cached_property
    def shortfall(self) -> np.ndarray:
        """Least number by which all limits would have to be multiplied, (N,).

        1 where they suffice, inf where no limits would do, NaN where the sample fails otherwise.
        """
        known = self.ok | (self.evaluation.status == Status.infeasible)
        return np.where(known, self.evaluation.shortfall, np.nan)

    @cached_property
    def near(self) -> np.ndarray:
        """Index into `KINDS` of the singularity that is near, (N,) int8; 0 at failed samples."""
        kind = self.evaluation.configuration.singularity.kind().astype(np.int8)
        return kind if self.all_ok else np.where(self.ok, kind, 0).astype(np.int8)


# Which solutions have a quantity, besides what a simulation brings and what was computed.
CONDITIONS: dict[str, Callable[[Derived], bool]] = {
    "solution": lambda d: True,
    "friction": lambda d: any(c.friction.coefficient for c in d.mechanism.contacts),
    "limits": lambda d: any(limits(chain).limited for chain in d.mechanism.chains),
    "limited": lambda d: d.limited,
    "muscles": lambda d: bool(muscles(d.mechanism.chains)),
    "ligaments": lambda d: bool(d.mechanism.ligaments),
    "compliance": lambda d: compliant(d.mechanism),
    "walls": lambda d: bool(d.mechanism.enabled_walls),
    "gravity": lambda d: "gravity" in d.given,
    "base": lambda d: "base" in d.given,
    # Of measures, which ask for it; solutions have none.
    "modes": lambda d: (
        any(not chain.rigid for chain in d.mechanism.chains)
        if d.evaluation is None
        else hasattr(d.evaluation, "frequency")
    ),
    "measured": lambda d: False,  # added to solutions: see `measured`
}
