"""What a model returns: numbers by attribute, and why some could not be computed."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from ..kinematics.causes import causes, owners, sample_error, unreachable_text
from ..kinematics.singularities import Singularity
from ..mechanism.mechanism import Mechanism
from .arguments import Lead

Array = np.ndarray


@dataclass
class Quantity:
    """An attribute of results: its shape behind the leading one, unit, and what it is.

    It speaks where a result has no such number of its own.
    """

    shape: str
    unit: str
    meaning: str

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, result: ModelResult | None, owner: type) -> Any:
        if result is None:
            return self
        raise AttributeError(
            f"{self.name} was not asked for: outputs=({self.name!r},) or outputs='all' of the "
            f"method that has it asks for it. Here are {', '.join(vars(result))}"
        )


def _item(shape: str, unit: str, meaning: str) -> Any:
    return Quantity(shape, unit, meaning)


class ModelResult:
    """Results of a model by attribute, each with the leading shape of what was given.

    Which attributes there are depends on the method and on `outputs`; the result shows its own,
    with units and meanings. Numbers that could not be computed are NaN; `status` is the reason.
    """

    effort: Array = _item("n", "N m or N", "of the actuators, in the order of the file")
    acceleration: Array = _item("m", "m/s^2, rad/s^2", "of the independent coordinates")
    contact_force: Array = _item("k", "N", "on the platform, along the unit normals")
    all_accelerations: Array = _item("s, m", "m/s^2, rad/s^2", "of every solution, else NaN")
    all_contact_forces: Array = _item("s, k", "N", "of every solution, else NaN")
    ambiguous: Array = _item("", "", "whether other motions follow from the same efforts")
    status: Array = _item("", "", "0 where it was computed, else of Status (PoseStatus)")
    bound: Array = _item("", "1", "of the relative error of all this, of the largest entry")
    share: Array = _item("parts, n", "N m or N", "of the effort, needed by each of Model.parts")
    gravity_share: Array = _item("parts, n", "N m or N", "the same at rest")
    q: Array = _item("m", "m, rad", "independent coordinates")
    pose: Array = _item("6", "m, rad", "X_EE")
    pose_rate: Array = _item("6", "m/s, rad/s", "X_EE'")
    pose_acceleration: Array = _item("6", "m/s^2, rad/s^2", "X_EE''")
    twist_rate: Array = _item("6", "m/s^2, rad/s^2", "V', omega' of the platform in {S}")
    joint: Array = _item("n", "rad or m", "coordinates of the actuated joints, principal values")
    joint_rate: Array = _item("n", "rad/s or m/s", "of the actuated joints")
    joint_acceleration: Array = _item("n", "rad/s^2 or m/s^2", "of the actuated joints")
    beta: Array = _item("n", "rad", "second angle of each chain, principal values")
    gamma: Array = _item("n", "rad", "third angle of each chain, principal values")
    cos_gamma: Array = _item("n", "1", "near 0 beta and gamma lose their meaning")
    discriminant: Array = _item("n", "1", "of a chain's assembly: negative out of reach")
    contact_point: Array = _item("k, 3", "m", "ball centres in {S}")
    contact_normal: Array = _item("k, 3", "1", "unit normals of the surfaces there, in {S}")
    configuration: ModelResult = _item("", "", "joint to contact_normal, and singularity")
    singularity: Singularity = _item("", "", "measures of [Cheng2023] Section 3.3")
    condition: Array = _item("", "1", "condition number of the dimensionless Jacobian J_W")
    slip: Array = _item("k, 3", "m/s", "velocity of the platform at the contacts, in {S}")
    friction_force: Array = _item("k, 3", "N", "on the platform at the contacts, in {S}")
    wall_force: Array = _item(
        "walls", "N", "of each enabled wall on the platform, along its normal"
    )
    shortfall: Array = _item("", "1", "least common factor on all limits that balances; 1 if met")
    residual_wrench: Array = _item("6", "N, N m", "in {S}, that emg's activations do not balance")
    residual: Array = _item("n", "rad or m", "given less computed joint coordinates")
    A: Array = _item("2 m, 2 m", "", "x' = A x + B effort, x = (q, v)")
    B: Array = _item("2 m, n", "", "likewise")
    J_theta: Array = _item("n, 6", "", "theta' = J_theta X_EE'")
    J: Array = _item("n, 6", "", "theta' = J [V; omega]: of no coordinates")
    twist_basis: Array = _item("6, m", "", "[V; omega] = twist_basis v, [Cheng2023] eqs (8), (11)")
    length_sensitivity: Array = _item("", "1", "d log singularity ratio / d log length")
    M_J: Array = _item("6, m", "", "X_EE' = M_J v, [Cheng2023] eq. (9)")
    M_1: Array = _item("n, 3, 3", "", "M_1 q_r' = M_2 X_EE' of every chain")
    M_2: Array = _item("n, 3, 6", "", "likewise")
    M_3: Array = _item("n, 3, 6", "", "q_r' = M_3 X_EE' of every chain")

    def __init__(self, **values: Any) -> None:
        self.__dict__.update(values)

    def __repr__(self) -> str:
        lines = []
        for name, value in vars(self).items():
            q = getattr(type(self), name)
            shape = str(value.shape) if isinstance(value, np.ndarray) else ""
            lines.append(f"  {name:18} {shape:16} {q.unit:16} {q.meaning}")
        return "\n".join([type(self).__name__, *lines])

    def shaped(self, lead: Lead) -> Self:
        """The same with this leading shape in the place of (N,)."""
        if len(lead) == 1:
            return self
        return type(self)(**{name: _shaped(value, lead) for name, value in vars(self).items()})

    def rows(self, start: int, stop: int) -> Self:
        """Some of flat samples."""
        return type(self)(**{name: _part(a, slice(start, stop)) for name, a in vars(self).items()})


def _part(value: Any, part: slice) -> Any:
    if isinstance(value, np.ndarray):
        return value[part]
    if isinstance(value, Singularity):
        own = {f.name: getattr(value, f.name) for f in fields(value)}
        changed: dict[str, Any] = {n: a[part] for n, a in own.items() if isinstance(a, np.ndarray)}
        return replace(value, **changed)
    return value.rows(part.start, part.stop)


def _shaped(value: Any, lead: Lead) -> Any:
    if isinstance(value, np.ndarray):
        return value.reshape((*lead, *value.shape[1:]))
    if isinstance(value, Singularity):
        own = {f.name: getattr(value, f.name) for f in fields(value)}
        changed = {n: _shaped(a, lead) for n, a in own.items() if isinstance(a, np.ndarray)}
        return replace(value, **changed)
    return value.shaped(lead)


def require_ok(
    mechanism: Mechanism, found: ModelResult, t: Array | None = None, row_offset: int = 0
) -> None:
    """Raise for samples that could not be computed, naming the first and its cause.

    Args: found: of inverse dynamics, with pose, configuration and shortfall.
          t: their times, (N,) [s]; without, they are rows of a file that start at `row_offset`.
    """
    c = found.configuration
    about = found.status, found.pose, c.discriminant, c.singularity
    error = sample_error(mechanism, *about, t, row_offset, found.shortfall)
    if error is not None:
        raise error


def unreachable_cause(mechanism: Mechanism, found: ModelResult, sample: int) -> str:
    """Which chain or contact cannot be where the sample wants it."""
    c = found.configuration
    cause = causes(found.status, found.pose, c.discriminant, c.singularity)[sample]
    return unreachable_text(mechanism, owners(mechanism)[cause], found.pose[sample])
