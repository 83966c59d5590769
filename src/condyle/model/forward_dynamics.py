"""Forward dynamics: accelerations and contact forces from states, efforts and wrenches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..backends.kernel import sample_rows
from ..questions.forward import SETS
from ..status import Status
from .arguments import Argument, Lead
from .dynamics import Dynamics
from .model_result import ModelResult
from .poses import Poses

Array = np.ndarray

# What the question is asked for each output, besides what always comes.
OUTPUTS = {
    **dict.fromkeys(("pose", "pose_rate", "pose_acceleration"), "motion"),
    **dict.fromkeys(("joint", "joint_rate", "joint_acceleration"), "joint"),
    "configuration": "motion",
    "condition": "motion",
    "twist_rate": "twist",
    "all_accelerations": "contact",
    "all_contact_forces": "contact",
    "slip": "sliding",
    "friction_force": "sliding",
}
# Results that are NaN in a gimbal lock, and those that are NaN where there is no solution.
OF_ANGLES = ("acceleration", "pose_acceleration", "bound")
DEPENDENT = (*OF_ANGLES, "contact_force", "joint_acceleration", "twist_rate")
EVERY = {"all_accelerations": "acceleration", "all_contact_forces": "contact_force"}


@dataclass(eq=False)
class ForwardDynamics(Dynamics):
    """The accelerations under efforts and wrenches; see `Model`."""

    asks = "forward", SETS
    results = ("acceleration", "contact_force", "bound")
    outputs = OUTPUTS

    poses: Poses

    @property
    def third(self) -> Argument:
        return self.arguments.effort

    def question(self, with_contact_force: bool) -> tuple[tuple[Any, ...], dict[str, Array]]:
        return ("forward", ("contact", "bound") if with_contact_force else ("contact",)), {}

    def _solve_samples(
        self, lead: Lead, inputs: dict[str, Array], names: tuple[str, ...], threads: int | None
    ) -> ModelResult:
        kernel, spare = self._kernel(names)
        answer = kernel.run(inputs, threads, spare)
        answer.mend(inputs, lambda rows: self.system.robust.forward(rows))
        if self._needs_motion:
            self.system.mark_overlaps(answer.status, answer.values["pose"].T, inputs)
        values, status = answer.values, answer.status
        if status.any():
            for name in {*DEPENDENT} & values.keys():
                known = (Status.ok,) if name in OF_ANGLES else (Status.ok, Status.gimbal_lock)
                values[name][..., ~np.isin(status, known)] = np.nan
        first: dict[str, Any] = {name: np.moveaxis(a, -1, 0) for name, a in values.items()}
        if "friction_force" in names:
            first["friction_force"] = -np.abs(first["contact_force"])[..., None] * first["drag"]
        if {*EVERY} & {*names}:
            first |= self._every(inputs, first, status)
        if {"configuration", "condition"} & {*names}:
            first["configuration"] = c = self.poses.configuration(first["pose"], threads)
            first["condition"] = c.singularity.condition
        found = {name: first[name] for name in (*self.results, *names)}
        return ModelResult(**found, status=status).shaped(lead)

    def _every(
        self, inputs: Mapping[str, Array], first: Mapping[str, Array], status: Array
    ) -> dict[str, Array]:
        """All solutions under friction, the one of `ok` samples first: (N, s, m) and (N, s, k)."""
        values, better = {}, dict[str, Array]()
        several = np.flatnonzero(status == Status.ambiguous)
        if several.size:
            better = self.system.robust.forward(sample_rows(inputs, several, len(status)))[0]
        for name, own in EVERY.items():
            count, size = first[own].shape
            every = np.full((count, 2 ** len(self.system.structure.friction), size), np.nan)
            every[:, 0] = first[own]
            if several.size:
                every[several] = np.moveaxis(better[name], -1, 0)
            values[name] = every
        return values
