"""Parts and actuators of a model of MuJoCo as the tables of a mechanism file."""

from __future__ import annotations

from typing import Any

import numpy as np

from .mjcf_graph import Graph, Step

OFF_LINE = 1e-3  # of a rod: what is nearer to its line is on it


def part(
    graph: Graph, what: str, group: int, start: np.ndarray, line: np.ndarray, rod: bool = False
) -> dict[str, float]:
    """Mass, mass centre along a line and moments, of a body taken as symmetric about it.

    rod: the centre is a part of the line's length, and the body may have no mass.
    """
    body = graph.body(group)
    length = float(np.linalg.norm(line))
    n, arm = line / length, body.centre - start
    com = float(arm @ n)
    off = float(np.linalg.norm(arm - com * n))
    axial = float(n @ body.inertia @ n)
    transverse = float((np.trace(body.inertia) - axial) / 2)
    across = np.linalg.svd(n[None])[2][1:]
    uneven = np.linalg.eigvalsh(across @ body.inertia @ across.T) - transverse
    side = body.inertia @ n - axial * n
    if off > OFF_LINE * max(abs(com), 1e-3):
        graph.note(f"{what}: its mass centre is {off * 1e3:.3g} mm off its line; taken on it")
    if max(np.abs(uneven).max(), np.linalg.norm(side)) > 1e-3 * max(transverse, 1e-30):
        graph.note(f"{what}: it is not symmetric about its line; taken so")
    return {
        "mass": body.weight if rod else body.mass,
        "com": min(max(com / length, 0.0), 1.0) if rod else max(com, 0.0),
        "transverse": transverse,
        "axial": min(axial, 2 * transverse),
    }


def actuator_of(graph: Graph, step: Step, sign: float, name: str) -> dict[str, Any]:
    """The actuator of a driven joint; `sign`: of its coordinate against ours."""
    m = graph.model
    dof = int(m.jnt_dofadr[step.index])
    table = _losses(m.dof_armature[dof], m.dof_damping[dof], m.dof_frictionloss[dof])
    drives = _drives(m, step.index, joint=True)
    if not drives:
        graph.note(f"joint {name} has no actuator; it is taken as the driven one")
    if (limit := _limit(m, drives, sign)) is not None:
        low, high = limit
        key = "force_limit" if step.kind == "slide" else "torque_limit"
        table[key] = high if low == -high else limit
    speed = f"speed_limit_{name}"
    if any(m.numeric(i).name == speed for i in range(m.nnumeric)):
        table["speed_limit"] = float(m.numeric(speed).data[0])
    return {"actuator": table} if table else {}


def cable_actuator(graph: Graph, tendon: int) -> dict[str, Any]:
    """That of a tendon, which can only pull."""
    m = graph.model
    armature = getattr(m, "tendon_armature", np.zeros(m.ntendon))[tendon]
    table = _losses(armature, m.tendon_damping[tendon], m.tendon_frictionloss[tendon])
    limit = _limit(m, _drives(m, tendon, joint=False), -1.0)
    if limit is not None and limit[1] > 0:
        table["force_limit"] = [max(limit[0], 0.0), limit[1]]
    return {"actuator": table} if table else {}


def _losses(armature: float, damping: Any, friction: float) -> dict[str, Any]:
    values = {"rotor_inertia": armature, "viscous": np.ravel(damping)[0], "coulomb": friction}
    return {key: float(value) for key, value in values.items() if value > 0}


def _drives(m: Any, index: int, joint: bool) -> list[int]:
    """Actuators of a joint or a tendon."""
    of = [i for i in range(m.nu) if m.actuator_trnid[i, 0] == index]
    return [i for i in of if (int(m.actuator_trntype[i]) in (0, 1)) == joint]  # or jointinparent


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
