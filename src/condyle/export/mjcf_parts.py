"""Bodies and actuators of a model of MuJoCo as the tables of a mechanism file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .mjcf_graph import Body, Graph, Step

DIGITS = 12  # of coordinates in a file [m]: below this MuJoCo's own rounding begins
OFF_LINE = 1e-3  # of a rod: what is nearer to its line is on it


@dataclass
class Parts:
    """graph; origin: of {S}, the platform's mass centre, (3,);  notes: what is left out."""

    graph: Graph
    origin: np.ndarray
    notes: list[str] = field(default_factory=list)

    def point(self, at: np.ndarray) -> list[float]:
        """A point of the world in {S}."""
        return [round(float(v), DIGITS) + 0.0 for v in at - self.origin]

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    def mass(self, index: int, body: Body) -> float:
        """0 for a body that is there because MuJoCo has none without mass."""
        weightless = float(self.graph.model.body_gravcomp[index]) == 1.0
        return 0.0 if weightless else body.mass


def across(
    parts: Parts, what: str, body: Body, start: np.ndarray, n: np.ndarray
) -> dict[str, float]:
    """com along a line [m], and moments across and along it, of a body symmetric about it."""
    arm = body.centre - start
    com = float(arm @ n)
    off = float(np.linalg.norm(arm - com * n))
    axial = float(n @ body.inertia @ n)
    transverse = float((np.trace(body.inertia) - axial) / 2)
    side = body.inertia @ n - axial * n
    uneven = float(np.abs(np.linalg.eigvalsh(_plane(body.inertia, n)) - transverse).max())
    if off > OFF_LINE * max(abs(com), 1e-3):
        parts.note(f"{what}: its mass centre is {off * 1e3:.3g} mm off its line; taken on it")
    if max(uneven, float(np.linalg.norm(side))) > 1e-3 * max(transverse, 1e-30):
        parts.note(f"{what}: it is not symmetric about its line; taken so")
    return {"com": com, "transverse": transverse, "axial": min(axial, 2 * transverse)}


def _plane(inertia: np.ndarray, n: np.ndarray) -> np.ndarray:
    """The part of a tensor across a unit vector, (2, 2)."""
    basis = np.linalg.svd(n[None])[2][1:]
    return basis @ inertia @ basis.T


def actuator_of(parts: Parts, step: Step, sign: float, name: str) -> dict[str, Any]:
    """The actuator of a driven joint; `sign`: of its coordinate against ours."""
    m = parts.graph.model
    dof = int(m.jnt_dofadr[step.index])
    linear = step.kind == "slide"
    table = _losses(m.dof_armature[dof], m.dof_damping[dof], m.dof_frictionloss[dof])
    drives = [i for i in range(m.nu) if m.actuator_trnid[i, 0] == step.index and _at_joint(m, i)]
    if not drives:
        parts.note(f"joint {name} has no actuator; it is taken as the driven one")
    if (limit := _limit(m, drives, sign)) is not None:
        table["force_limit" if linear else "torque_limit"] = _plain(limit)
    speed = f"speed_limit_{name}"
    if any(m.numeric(i).name == speed for i in range(m.nnumeric)):
        table["speed_limit"] = float(m.numeric(speed).data[0])
    return {"actuator": table} if table else {}


def cable_actuator(parts: Parts, tendon: int) -> dict[str, Any]:
    m = parts.graph.model
    table = _losses(
        getattr(m, "tendon_armature", np.zeros(m.ntendon))[tendon],
        np.ravel(m.tendon_damping[tendon])[0],
        m.tendon_frictionloss[tendon],
    )
    drives = [i for i in range(m.nu) if m.actuator_trnid[i, 0] == tendon and not _at_joint(m, i)]
    limit = _limit(m, drives, -1.0)
    if limit is not None and limit[1] > 0:
        table["force_limit"] = [max(limit[0], 0.0), limit[1]]
    return {"actuator": table} if table else {}


def _losses(armature: float, damping: float, friction: float) -> dict[str, Any]:
    values = {"rotor_inertia": armature, "viscous": np.ravel(damping)[0], "coulomb": friction}
    return {key: float(value) for key, value in values.items() if value > 0}


def _at_joint(m: Any, i: int) -> bool:
    return int(m.actuator_trntype[i]) in (0, 1)  # joint, jointinparent


def _plain(limit: list[float]) -> float | list[float]:
    """One number where it is the same in both directions."""
    return limit[1] if limit[0] == -limit[1] else limit


def _limit(m: Any, drives: list[int], sign: float) -> list[float] | None:
    """Of force, or of the control of a plain motor, through the gear."""
    for i in drives:
        gear = sign * float(m.actuator_gear[i, 0])
        motor = m.actuator_biastype[i] == 0 and m.actuator_gaintype[i] == 0
        ends = None
        if m.actuator_forcelimited[i]:
            ends = m.actuator_forcerange[i]
        elif m.actuator_ctrllimited[i] and motor:
            ends = m.actuator_ctrlrange[i] * m.actuator_gainprm[i, 0]
        if ends is not None and ends[0] < ends[1]:
            return sorted(float(gear * end) for end in ends)
    return None
