"""What a model returns: numbers by attribute."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Self

import numpy as np

from ..kinematics.singularities import Singularity
from ..quantities import QUANTITIES
from .arguments import Lead

Array = np.ndarray


# Results that have results of their own.
GROUPS = {
    "configuration": "joint to contact_normal, and singularity",
    "singularity": "measures of [Cheng2023] Section 3.3",
}


class ModelResult:
    """Results of a model by attribute, each with the leading shape of what was given.

    Which attributes there are depends on the method and on `outputs`; the result shows its own,
    with units and meanings. Numbers that could not be computed are NaN; `status` is the reason.
    """

    # For editors; a test holds them to what results have, which `QUANTITIES` says.
    configuration: ModelResult
    singularity: Singularity
    effort: Array
    contact_force: Array
    indentation: Array
    shortfall: Array
    residual_wrench: Array
    share: Array
    gravity_share: Array
    ambiguous: Array
    contact_active: Array
    acceleration: Array
    twist_rate: Array
    all_accelerations: Array
    all_contact_forces: Array
    slip: Array
    friction_force: Array
    wall_force: Array
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
    residual: Array
    contact_point: Array
    contact_normal: Array
    J: Array
    J_theta: Array
    M_J: Array
    M_1: Array
    M_2: Array
    M_3: Array
    twist_basis: Array
    length_sensitivity: Array
    A: Array
    B: Array
    K: Array
    geometric: Array
    compliance: Array
    translation: Array
    translation_axis: Array
    rotation: Array
    rotation_axis: Array
    eigenscrew_compliance: Array
    eigenscrew: Array
    frequency: Array
    shape: Array
    damping: Array
    eigenvalue: Array
    displacement: Array
    condition: Array
    bound: Array
    status: Array

    def __init__(self, **values: Any) -> None:
        self.__dict__.update(values)

    def __getattr__(self, name: str) -> Any:
        """Raises AttributeError with the outputs that were requested."""
        if name not in QUANTITIES and name not in GROUPS:
            raise AttributeError(f"unknown result {name}; available: {', '.join(vars(self))}")
        raise AttributeError(
            f"{name} was not requested; pass outputs=({name!r},) or outputs='all' to the method "
            f"that has it. Available: {', '.join(vars(self))}"
        )

    def __repr__(self) -> str:
        lines = []
        for name, value in vars(self).items():
            shape, unit, meaning = "", "", GROUPS.get(name, "")
            if isinstance(value, np.ndarray):
                shape, quantity = str(value.shape), QUANTITIES[name]
                unit, meaning = quantity.any_unit(), quantity.meaning
            lines.append(f"  {name:18} {shape:16} {unit:16} {meaning}")
        return "\n".join([type(self).__name__, *lines])

    def shaped(self, lead: Lead) -> Self:
        """The same with this leading shape in the place of (N,)."""
        if len(lead) == 1:
            return self
        return _changed(self, lambda a: a.reshape((*lead, *a.shape[1:])))

    def rows(self, start: int, stop: int) -> Self:
        """Some of flat samples."""
        return _changed(self, lambda a: a[start:stop])


def _changed(value: Any, change: Callable[[Array], Array]) -> Any:
    """An array, or the same with all arrays in it changed."""
    if isinstance(value, np.ndarray):
        return change(value)
    own = {name: _changed(a, change) for name, a in vars(value).items() if not np.isscalar(a)}
    return replace(value, **own) if isinstance(value, Singularity) else type(value)(**own)
