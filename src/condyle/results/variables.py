"""The variables of a solution in one table: dataset, columns of CSV and docs follow from it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from ..kinematics.causes import owners
from ..kinematics.chain import FAMILIES
from ..kinematics.chain.muscle import muscles
from ..kinematics.singularities import KINDS
from ..mechanism.chain import limits
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..status import STATUS_NAMES
from .contacts import AXES
from .derived import Derived

# How efforts were chosen, as the description of `effort` says it.
LEAST = "minimum_norm"
CHOICES = {
    LEAST: "of least norm",
    "bounded": "of least norm within limits",
    "weighted": "of least squares over limits, within them",
    "cubic": "of least cubes over limits, within them",
    "minimax": "of least maximum of |effort| over limit",
}

# What the energy of a simulation went to.
ACCOUNTS = (
    "kinetic", "potential", "actuators", "load", "actuator_losses", "contact_friction"
)  # fmt: skip
WRENCH = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")

BASE_PARTS = ("base_acceleration", "base_angular_velocity", "base_angular_acceleration")

Rule = Callable[[Mechanism], str]


def with_friction(derived: Derived) -> bool:
    return any(contact.friction.coefficient for contact in derived.mechanism.contacts)


def given(name: str) -> Callable[[Derived], bool]:
    """Whether every sample gives that: gravity, or the base's motion."""
    return lambda derived: name in derived.given


def with_limits(derived: Derived) -> bool:
    return any(limits(chain).limited for chain in derived.mechanism.chains)


def with_muscles(derived: Derived) -> bool:
    return bool(muscles(derived.mechanism.chains))


def with_walls(derived: Derived) -> bool:
    return bool(derived.mechanism.enabled_walls)


def with_ligaments(derived: Derived) -> bool:
    return bool(derived.mechanism.ligaments)


@dataclass(frozen=True)
class Variable:
    """A variable of a solution.

    units:  or a rule that gives them for a mechanism; with several, one an entry or a chain.
    place:  of its values in a `Derived`, as attributes; "" where a simulation brings them, by
            name. Floating-point ones become NaN where a sample failed.
    column: what the names of its columns begin with in CSV, before that of the entry; None: it
            has none there.
    flags:  what its integers mean, or a rule for that: words that a blank parts.
    only:   whether a solution has it at all.
    failed: whether failed samples may have a value too.
    sizes:  of vectors along the last dimension stand in CSV, not their components.
    """

    name: str
    dims: tuple[str, ...]
    units: str | Rule
    meaning: str
    place: str = ""
    column: str | None = None
    flags: str | Rule = ""
    only: Callable[[Derived], bool] | None = None
    failed: bool = False
    sizes: bool = False

    @property
    def simulated(self) -> bool:
        """Whether only a simulation has it."""
        return not self.place

    def when(self, derived: Derived) -> bool:
        """Whether a solution has it."""
        if self.simulated:
            return self.name in derived.simulated
        return self.only is None or self.only(derived)

    def values(self, derived: Derived) -> np.ndarray:
        """Its values; floating-point ones of failed samples may be anything."""
        return derived.simulated[self.name] if self.simulated else attrgetter(self.place)(derived)

    def filled(self, derived: Derived) -> np.ndarray:
        """Its values; numbers of failed samples are NaN."""
        values = self.values(derived)
        if values.dtype.kind == "f" and not (derived.all_ok or self.failed):
            values = values.copy()
            values[(slice(None),) * self.dims.index("time") + (~derived.ok,)] = np.nan
        return values

    def attributes(self, mechanism: Mechanism) -> dict[str, str]:
        """`units`, `long_name` and, where there are flags, `flag_meanings`."""
        units = self.units if isinstance(self.units, str) else self.units(mechanism)
        flags = self.flags if isinstance(self.flags, str) else self.flags(mechanism)
        named = {"flag_meanings": flags} if flags else {}
        return {"units": units, "long_name": self.meaning, **named}


def labels_of(mechanism: Mechanism) -> dict[str, Sequence[str]]:
    """Labels along the dimensions that columns have."""
    chains, contacts = mechanism.chain_names, mechanism.contact_names
    names: dict[str, Sequence[str]] = {"chain": chains, "contact": contacts}
    names |= {"ligament": mechanism.ligament_names} if mechanism.ligaments else {}
    names |= {"wall": walls} if (walls := [wall.name for wall in mechanism.enabled_walls]) else {}
    return names | {"coordinate": COORDINATES, "axis": AXES}


def variable_columns(
    variable: Variable, values: np.ndarray, labels: Mapping[str, Iterable[str]]
) -> dict[str, np.ndarray]:
    """Columns of a variable that has some, by labels along its dimensions; sizes of vectors."""
    assert variable.column is not None
    if len(variable.dims) == 1:
        return {variable.column: values}
    values = np.linalg.norm(values, axis=-1) if variable.sizes else values
    return named_columns(variable.column, labels[variable.dims[1]], values)


def named_columns(prefix: str, names: Iterable[str], values: np.ndarray) -> dict[str, np.ndarray]:
    """Columns (N, entries) by their names."""
    return {f"{prefix}{name}": values[:, i] for i, name in enumerate(names)}


def of_independent(form: str) -> Rule:
    """Units of q_EE: metres and radians by its coordinates."""
    return lambda mechanism: _each(
        ("m" if n in "XYZ" else "rad" for n in independent_coordinates(mechanism)), form
    )


def chosen(distribution: str) -> str:
    """What `effort` is under a distribution; one from elsewhere is called by its name."""
    return f"actuator effort {CHOICES.get(distribution, f'by distribution {distribution}')}"


def of_effort(form: str = "{}") -> Rule:
    """Units of efforts, each kind that the chains have, in a form such as '{}/s'."""
    return lambda mechanism: _each((FAMILIES[c.kind].effort_unit for c in mechanism.chains), form)


def of_joint(form: str = "{}") -> Rule:
    """Likewise of joint coordinates."""
    return lambda mechanism: _each((FAMILIES[c.kind].joint_unit for c in mechanism.chains), form)


def of_pose(form: str) -> str:
    """Units of X_EE: one for each coordinate."""
    return ", ".join(form.format(unit) for unit in ("m", "m", "m", "rad", "rad", "rad"))


def cause_flags(mechanism: Mechanism) -> str:
    """The causes of failed samples, each without a blank."""
    return " ".join(str(owner).replace(" ", "_") or "none" for owner in owners(mechanism))


def _each(units: Iterable[str], form: str) -> str:
    """The unit that all entries have, or one an entry."""
    found = [form.format(unit) for unit in units]
    return found[0] if len({*found}) == 1 else ", ".join(found)


_CHAIN, _POSE, _CONTACT = ("time", "chain"), ("time", "coordinate"), ("time", "contact")
_VECTOR = ("time", "axis")
_PLACE = (*_CONTACT, "axis")
_FREE = ("time", "independent")

# Those with columns come first, in the order of the columns.
# fmt: off
VARIABLES = (
    Variable("effort", _CHAIN, of_effort(), chosen(LEAST), "evaluation.effort", column="tau_"),
    Variable(
        "contact_force", _CONTACT, "N",
        "contact force on the platform along the unit normal of the surface",
        "evaluation.contact_force", column="contact_",
    ),
    Variable(
        "pose", _POSE, of_pose("{}"), "pose of the platform X_EE", "evaluation.pose", column="",
    ),
    Variable(
        "joint", _CHAIN, of_joint(), "joint coordinate, zero at home",
        "evaluation.configuration.joint", column="joint_",
    ),
    Variable(
        "sliding_speed", _CONTACT, "m/s",
        "speed of the platform where it touches, where contacts have friction", "sliding_speed",
        column="sliding_", only=with_friction,
    ),
    Variable(
        "friction_force", _PLACE, "N", "friction on the platform in {S}, where contacts have some",
        "evaluation.friction_force", column="friction_", only=with_friction, sizes=True,
    ),
    Variable(
        "friction_power", _CONTACT, "W",
        "power of friction on the platform, never positive, where contacts have friction",
        "friction_power", only=with_friction,
    ),
    Variable(
        "command", _CHAIN, of_effort(), "effort that the controller asks for", column="command_",
    ),
    Variable(
        "measured_joint", _CHAIN, of_joint(), "joint as its encoder reads", column="measured_",
    ),
    Variable(
        "estimate", _FREE, of_independent("{}"), "state as the controller takes it",
        column="estimate_",
    ),
    Variable("estimate_rate", _FREE, of_independent("{}/s"), "rate as the controller takes it"),
    Variable("reference", _FREE, of_independent("{}"), "state to follow", column="reference_"),
    Variable("reference_rate", _FREE, of_independent("{}/s"), "rate to follow"),
    Variable(
        "tracking_error", _FREE, of_independent("{}"), "reference less state", column="error_",
    ),
    Variable(
        "bite_force", ("time",), "N", "force that the controller measures", column="bite_force",
    ),
    Variable(
        "load_estimate", _VECTOR, "N",
        "force on the platform at the observer's point, in {S}, as it estimates it",
        column="load_estimate_",
    ),
    Variable(
        "estimate_covariance", ("time", "estimated", "beside"), "m, rad, per s, N",
        "covariance of the observer's state: estimate, its rate, load",
    ),
    Variable(
        "innovation", ("time",), "1",
        "normalised square of what the encoders say beyond the observer's prediction; its mean is "
        "the number of freedoms where the noises are as given", column="innovation",
    ),
    Variable("bite_reference", ("time",), "N", "force to bite with", column="bite_reference"),
    Variable(
        "load_force", ("time", "source", "axis"), "N", "force of each load on the platform in {S}",
        column="load_", sizes=True,
    ),
    Variable(
        "load_mode", ("time", "source"), "1",
        "mode of each load: of food 0 apart, 1 between the teeth, 2 broken; of unloading 0 whole, "
        "1 broken",
    ),
    Variable(
        "gravity", _VECTOR, "m/s^2", "gravity in {S} that the motion gives", "gravity",
        column="g", only=given("gravity"), failed=True,
    ),
    Variable(
        "base_acceleration", _VECTOR, "m/s^2", "acceleration of the origin of {S}",
        "base_acceleration", column="base_a", only=given("base"), failed=True,
    ),
    Variable(
        "base_angular_velocity", _VECTOR, "rad/s", "angular velocity of the base in {S}",
        "base_angular_velocity", column="base_w", only=given("base"), failed=True,
    ),
    Variable(
        "base_angular_acceleration", _VECTOR, "rad/s^2",
        "angular acceleration of the base in {S}", "base_angular_acceleration",
        column="base_dw", only=given("base"), failed=True,
    ),
    Variable(
        "energy", ("time", "account"), "J",
        "kinetic and potential energy, work of actuators and loads, losses since the start",
    ),
    Variable("actuator_loss", _CHAIN, "W", "power that the actuator's own friction takes"),
    Variable(
        "actuator_power", _CHAIN, "W", "power of the actuator: effort times joint rate",
        "actuator_power",
    ),
    Variable(
        "activation", _CHAIN, "1",
        "effort over the greatest |limit| of its chain, where chains have limits; nan without one; "
        "of a muscle its activation",
        "activation", only=with_limits,
    ),
    Variable(
        "excitation", _CHAIN, "1", "excitation of a muscle, which its activation follows",
        column="excitation_",
    ),
    Variable(
        "fibre_length", _CHAIN, "1", "length of a muscle's fibres over the optimal one",
        "muscle.length", only=with_muscles,
    ),
    Variable(
        "fibre_speed", _CHAIN, "1",
        "speed of a muscle's fibres over the greatest one, positive when they lengthen",
        "muscle.speed", only=with_muscles,
    ),
    Variable(
        "passive_force", _CHAIN, "N", "part of a muscle's tension that its passive fibres bear",
        "muscle.passive", only=with_muscles,
    ),
    Variable(
        "ligament_force", ("time", "ligament"), "N", "tension of each ligament",
        "passive.ligament_force", column="ligament_", only=with_ligaments,
    ),
    Variable(
        "ligament_length", ("time", "ligament"), "m", "length of each ligament",
        "passive.ligament_length", only=with_ligaments,
    ),
    Variable(
        "wall_force", ("time", "wall"), "N", "force of each wall on the platform along its normal",
        "wall_force", column="wall_", only=with_walls,
    ),
    Variable(
        "wall_gap", ("time", "wall"), "m", "distance of its point from each wall, negative beyond",
        "passive.wall_gap", column="gap_", only=with_walls,
    ),
    Variable(
        "shortfall", ("time",), "1",
        "least factor on all limits with which efforts within limits exist: 1 where the limits "
        "suffice, inf where no factor does",
        "shortfall", only=attrgetter("limited"), failed=True,
    ),
    Variable(
        "residual", ("time", "component"), "N, N m",
        "wrench in {S} that activations of emg leave unbalanced, its moment about O_M",
        "evaluation.residual_wrench",
        only=lambda derived: hasattr(derived.evaluation, "residual_wrench"),
    ),
    Variable("pose_rate", _POSE, of_pose("{}/s"), "rate of X_EE", "evaluation.pose_rate"),
    Variable(
        "pose_acceleration", _POSE, of_pose("{}/s^2"), "acceleration of X_EE",
        "evaluation.pose_acceleration",
    ),
    Variable(
        "share", ("part", *_CHAIN), of_effort(), "effort that each part of the mechanism needs",
        "share",
    ),
    Variable(
        "contact_loss", _CONTACT, "1",
        "whether a unilateral contact would have to pull: contact is lost", "contact_loss",
    ),
    Variable(
        "contact_point", _PLACE, "m", "centre of the contact ball in {S}",
        "evaluation.configuration.contact_point",
    ),
    Variable(
        "contact_normal", _PLACE, "1", "unit normal of the surface at the contact in {S}",
        "evaluation.configuration.contact_normal",
    ),
    Variable(
        "bound_margin", _CONTACT, "m",
        "distance of the contact point to its nearest bound; negative outside", "margin",
    ),
    Variable("joint_rate", _CHAIN, of_joint("{}/s"), "joint rate", "evaluation.joint_rate"),
    Variable(
        "joint_acceleration", _CHAIN, of_joint("{}/s^2"), "joint acceleration",
        "evaluation.joint_acceleration",
    ),
    Variable("rod_beta", _CHAIN, "rad", "rod angle beta_i", "evaluation.configuration.beta"),
    Variable("rod_gamma", _CHAIN, "rad", "rod angle gamma_i", "evaluation.configuration.gamma"),
    Variable("load", ("time", "component"), "N, N m", "load on the platform in {S}", "wrench"),
    Variable(
        "J_A", _CHAIN, of_joint("m^2/{}"), "diagonal of J_A, eq. (26)",
        "evaluation.configuration.singularity.J_A",
    ),
    Variable(
        "transmission", _CHAIN, "1", "J_A made dimensionless",
        "evaluation.configuration.singularity.transmission",
    ),
    Variable(
        "J_W_sigma", ("time", "independent"), "1", "singular values of the dimensionless J_W",
        "evaluation.configuration.singularity.J_W_sigma",
    ),
    Variable(
        "condition", ("time",), "1", "condition number of J_W",
        "evaluation.configuration.singularity.condition",
    ),
    Variable(
        "rank", ("time",), "1", "rank of J_W; 0 where the pose cannot be reached",
        "evaluation.configuration.singularity.rank",
    ),
    Variable(
        "singularity_ratio", ("time",), "1", "smallest over largest singular value of J_A or J_W",
        "evaluation.configuration.singularity.ratio",
    ),
    Variable(
        "singularity", ("time",), "1", "kind of singularity that is near", "near",
        flags=" ".join(KINDS),
    ),
    Variable(
        "bound", ("time",), "1", "bound of the relative error of what was computed",
        "evaluation.bound", only=lambda derived: hasattr(derived.evaluation, "bound"),
    ),
    Variable("status", ("time",), "1", "status", "status", flags=" ".join(STATUS_NAMES)),
    Variable("cause", ("time",), "1", "cause of the failure", "cause", flags=cause_flags),
)
# fmt: on
BY_NAME = {variable.name: variable for variable in VARIABLES}

# Dimension -> what stands along it.
DIMENSIONS = {
    "time": "samples [s]",
    "chain": "names of the mechanism file",
    "contact": "names of the mechanism file",
    "ligament": "names of the mechanism file, where it has any",
    "wall": "names of enabled walls, where there are any",
    "coordinate": ", ".join(COORDINATES),
    "independent": "the independent coordinates; `J_W_sigma` has as many values, falling",
    "part": "platform, links of the chains and, where there is one, the base's motion, the "
    "passive forces of ligaments and walls, and the load; shares add up to the effort",
    "axis": f"{', '.join(AXES)} in {{S}}",
    "component": ", ".join(WRENCH),
    "source": "loads of a scenario, by name",
    "account": ", ".join(ACCOUNTS),
    "estimated": "the independent coordinates, their rates, and the load's components",
    "beside": "the same: columns of a covariance",
}
