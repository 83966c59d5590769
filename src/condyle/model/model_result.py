"""What a model returns: numbers by attribute, and why some could not be computed."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, NamedTuple, Self

import numpy as np

from ..kinematics.causes import causes, owners, sample_error, unreachable_text
from ..kinematics.singularities import Singularity
from ..mechanism.mechanism import Mechanism
from .arguments import Lead

Array = np.ndarray


class Quantity(NamedTuple):
    """Shape behind the leading one, unit, and what it is."""

    shape: str
    unit: str
    meaning: str


QUANTITIES = {
    "effort": Quantity("n", "N m or N", "of the actuators, in the order of the file"),
    "acceleration": Quantity("m", "m/s^2, rad/s^2", "of the independent coordinates"),
    "contact_force": Quantity("k", "N", "on the platform, along the unit normals"),
    "status": Quantity("", "", "0 where it was computed, else of Status (PoseStatus)"),
    "share": Quantity("parts, n", "N m or N", "of the effort, needed by each of Model.parts"),
    "gravity_share": Quantity("parts, n", "N m or N", "the same at rest"),
    "q": Quantity("m", "m, rad", "independent coordinates"),
    "pose": Quantity("6", "m, rad", "X_EE"),
    "pose_rate": Quantity("6", "m/s, rad/s", "X_EE'"),
    "pose_acceleration": Quantity("6", "m/s^2, rad/s^2", "X_EE''"),
    "joint": Quantity("n", "rad or m", "coordinates of the actuated joints, principal values"),
    "joint_rate": Quantity("n", "rad/s or m/s", "of the actuated joints"),
    "joint_acceleration": Quantity("n", "rad/s^2 or m/s^2", "of the actuated joints"),
    "beta": Quantity("n", "rad", "second angle of each chain, principal values"),
    "gamma": Quantity("n", "rad", "third angle of each chain, principal values"),
    "cos_gamma": Quantity("n", "1", "near 0 beta and gamma lose their meaning"),
    "discriminant": Quantity("n", "1", "of a chain's assembly: negative out of reach"),
    "contact_point": Quantity("k, 3", "m", "ball centres in {S}"),
    "contact_normal": Quantity("k, 3", "1", "unit normals of the surfaces there, in {S}"),
    "configuration": Quantity("", "", "joint to contact_normal, and singularity, as attributes"),
    "singularity": Quantity("", "", "measures of [Cheng2023] Section 3.3"),
    "condition": Quantity("", "1", "condition number of the dimensionless Jacobian J_W"),
    "slip": Quantity("k, 3", "m/s", "velocity of the platform at the contacts, in {S}"),
    "friction_force": Quantity("k, 3", "N", "on the platform at the contacts, in {S}"),
    "shortfall": Quantity("", "1", "least common factor on all limits that balances; 1 if met"),
    "residual": Quantity("n", "rad or m", "given less computed joint coordinates"),
    "A": Quantity("2 m, 2 m", "", "x' = A x + B effort, x = (q, v)"),
    "B": Quantity("2 m, n", "", "likewise"),
    "J_theta": Quantity("n, 6", "", "theta' = J_theta X_EE'"),
    "M_J": Quantity("6, m", "", "X_EE' = M_J v, [Cheng2023] eq. (9)"),
    "M_1": Quantity("n, 3, 3", "", "M_1 q_r' = M_2 X_EE' of every chain"),
    "M_2": Quantity("n, 3, 6", "", "likewise"),
    "M_3": Quantity("n, 3, 6", "", "q_r' = M_3 X_EE' of every chain"),
}


class ModelResult:
    """Results of a model by attribute, each with the leading shape of what was given.

    Which attributes there are depends on the method and on `outputs`; `QUANTITIES` has their
    shapes, units and meanings, and the result shows its own. Numbers that could not be computed
    are NaN; `status` is the reason.
    """

    effort: Array
    acceleration: Array
    contact_force: Array
    status: Array
    share: Array
    gravity_share: Array
    q: Array
    pose: Array
    pose_rate: Array
    pose_acceleration: Array
    joint: Array
    joint_rate: Array
    joint_acceleration: Array
    beta: Array
    gamma: Array
    cos_gamma: Array
    discriminant: Array
    contact_point: Array
    contact_normal: Array
    configuration: ModelResult
    singularity: Singularity
    condition: Array
    slip: Array
    friction_force: Array
    shortfall: Array
    residual: Array
    A: Array
    B: Array
    J_theta: Array
    M_J: Array
    M_1: Array
    M_2: Array
    M_3: Array

    def __init__(self, **values: Any) -> None:
        self.__dict__.update(values)

    def __getattr__(self, name: str) -> Any:
        if name not in QUANTITIES:
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        raise AttributeError(
            f"{name} was not asked for: outputs=({name!r},) or outputs='all' of the method that "
            f"has it asks for it. Here are {', '.join(vars(self))}"
        )

    def __repr__(self) -> str:
        lines = []
        for name, value in vars(self).items():
            q = QUANTITIES[name]
            shape = str(value.shape) if isinstance(value, np.ndarray) else ""
            lines.append(f"  {name:18} {shape:16} {q.unit:16} {q.meaning}")
        return "\n".join([type(self).__name__, *lines])

    def shaped(self, lead: Lead) -> Self:
        """The same with this leading shape in the place of (N,)."""
        if len(lead) == 1:
            return self
        return type(self)(**{name: _shaped(value, lead) for name, value in vars(self).items()})


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
