"""Forward dynamics: accelerations and contact forces from states, efforts and wrenches."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..backends.kernel import sample_rows
from ..questions.forward import OUTPUTS as ASKED
from ..status import Status
from .arguments import Arguments, requested
from .model_result import ModelResult
from .poses import Poses
from .system import System
from .unchecked import Dynamics

Array = np.ndarray

# What the question is asked for each output; the contact forces and the bound always come.
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


class ForwardDynamics(Dynamics):
    """What efforts and wrenches do to one mechanism; see `Model`."""

    results = ("acceleration", "contact_force", "bound")

    def __init__(self, system: System, arguments: Arguments, poses: Poses) -> None:
        super().__init__(system, arguments, arguments.effort)
        self._poses = poses

    def question(self, whole: bool) -> tuple[tuple[Any, ...], dict[str, Array]]:
        return ("forward", ("contact", "bound") if whole else ("contact",)), {}

    def many(
        self, state: Any, wrench: Any, at: Any, outputs: Any, threads: int | None
    ) -> ModelResult:
        names, own = requested(outputs, OUTPUTS), self._arguments
        lead, inputs = own.samples((own.q, own.v, own.effort), state, wrench, at)
        asked = {"contact", "bound", *(OUTPUTS[name] for name in names)}
        kernel = self._system.kernel("forward", tuple(name for name in ASKED if name in asked))
        answer = kernel.run(inputs, threads)
        answer.mend(inputs, lambda few: self._system.robust.forward(few))
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
            first["configuration"] = c = self._poses.configuration(first["pose"], threads)
            first["condition"] = c.singularity.condition
        found = {name: first[name] for name in (*self.results, *names)}
        return ModelResult(**found, status=status).shaped(lead)

    def _every(
        self, inputs: Mapping[str, Array], first: Mapping[str, Array], status: Array
    ) -> dict[str, Array]:
        """All solutions under friction, the one of `ok` samples first: (N, s, m) and (N, s, k)."""
        found, better = {}, dict[str, Array]()
        several = np.flatnonzero(status == Status.ambiguous)
        if several.size:
            better = self._system.robust.forward(sample_rows(inputs, several, len(status)))[0]
        for name, own in EVERY.items():
            count, size = first[own].shape
            every = np.full((count, 2 ** len(self._system.structure.friction), size), np.nan)
            every[:, 0] = first[own]
            if several.size:
                every[several] = np.moveaxis(better[name], -1, 0)
            found[name] = every
        return found

    def linearise(self, q: Any, v: Any, effort: Any, wrench: Any, at: Any) -> ModelResult:
        """As `Model.linearise`."""
        own = self._arguments
        lead, inputs = own.samples((own.q, own.v, own.effort), (q, v, effort), wrench, at)
        loads = np.hstack([inputs["force"], inputs["moment"]]), inputs["point"]
        states = [inputs[name] for name in ("q", "q1", "effort")]
        about = self.many(states, *loads, ("pose",), None)
        ports = {name: inputs[name] for name in ("q1", "effort", "force", "moment", "point")}
        ports |= {"pose": about.pose, "q2": about.acceleration}
        ports["contact_force"] = about.contact_force
        found = self._system.robust.linear(ports)
        s = {name: np.moveaxis(a, -1, 0) for name, a in found.items()}
        count, m = about.acceleration.shape
        A, B = np.zeros((count, 2 * m, 2 * m)), np.zeros((count, 2 * m, s["J"].shape[2]))
        A[:, :m, m:] = np.eye(m)
        good = about.status == Status.ok
        A[~good] = B[~good] = np.nan
        unknown = np.concatenate([s["by_q2"], s["by_force"]], axis=2)[good]
        known = np.concatenate([-s["by_q"], -s["by_q1"], s["J"]], axis=2)[good]
        solved = np.linalg.solve(unknown, known)[:, :m]
        A[good, m:], B[good, m:] = solved[..., : 2 * m], solved[..., 2 * m :]
        return ModelResult(A=A, B=B, status=about.status).shaped(lead)
