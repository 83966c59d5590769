"""Impedance at a point: it gives way to a force as a spring and a damper would.

    F = stiffness (p_d - p) + damping (v_d - v),
    effort = inverse dynamics of (q, q', q_c'') that also bears -F at the point,
    q_c'' = q_d'' + N (Kv (q_d' - q') + Kp (q_d - q)),    N = 1 - J^# J,
    J^# = M^-1 J^T (J M^-1 J^T)^-1,

with p, v the point's position and velocity in {S} and J (3, m) its Jacobian. The apparent inertia
is the mechanism's own, so no force has to be measured (Hogan, J. Dyn. Sys. Meas. Control 107 (1985)
1-24). The freedoms that the point leaves are held by `posture`, without a force at the point: N is
dynamically consistent (Khatib, IEEE J. Robotics and Automation 3 (1987) 43-53).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import casadi as ca
from pydantic import Field

from ...dynamics.least_norm import definite_solve
from ...mechanism.quantities import LoadPoint
from ..builder import Lanes
from ..entries import Gain, Gains, Machine
from .controller import Control, ControllerTable

RANK = 1e-10  # of the point's inverse inertia, beside its largest: below, it cannot move that way


class Impedance(ControllerTable):
    """A spring and a damper at a point of the platform."""

    ports: ClassVar[Mapping[str, str | int]] = {
        "stiffness": 3,
        "damping": 3,
        "posture": 1,
        "posture_damping": 1,
        "point": 3,
    }
    parameters: ClassVar[Mapping[str, str]] = {
        "stiffness": "N/m",
        "damping": "N s/m",
        "posture": "1/s²",
        "posture_damping": "1/s",
    }

    kind: Literal["impedance"]
    point: LoadPoint | None = Field(
        default=None, description="of the platform; default right_molar"
    )
    stiffness: Gains = Field(description="N/m; one, or along x, y, z of {S}")
    damping: Gains = Field(description="N s/m")
    posture: Gain = Field(default=400.0, description="Kp of the other freedoms, 1/s^2")
    posture_damping: Gain | None = Field(default=None, description="1/s; default 2 sqrt(posture)")

    def numbers(self, machine: Machine) -> Mapping[str, Any]:
        found, critical = super().numbers(machine), 2 * self.posture**0.5
        return {**found, "posture_damping": critical} if self.posture_damping is None else found

    def place(self, machine: Machine) -> str | None:
        return machine.place(self.point)

    @staticmethod
    def equations(c: Control) -> tuple[Lanes, ca.SX]:
        now, ref, g = c.measured, c.reference, c.gains
        p, p_d = c.point(now.q, g.point), c.point(ref.q, g.point)
        force = g.stiffness * (p_d.position - p.position)
        force += g.damping * (p_d.J @ ref.q1 - p.J @ now.q1)
        free = g.posture_damping * (ref.q1 - now.q1) + g.posture * (ref.q - now.q)
        held = led(free, p.J, c.inertia(now.q), ca.SX.zeros(3))
        return c.inverse(now.q, now.q1, ref.q2 + held, -force, g.point), c.memory


def led(free: ca.SX, J: ca.SX, M: ca.SX, wanted: ca.SX) -> ca.SX:
    """The acceleration, (m,), nearest to `free` with J q'' = wanted, (r,), where J can move.

    By Gram and Schmidt in the metric of M^-1, for which rows may depend on one another.
    """
    rows = ca.vertsplit(J)
    by = ca.horzsplit(definite_solve(M, J.T, ca.diag(M))[0])
    aims = ca.vertsplit(wanted)
    largest = ca.SX(0)
    for row, w in zip(rows, by, strict=True):
        largest = ca.fmax(largest, row @ w)
    for i in range(len(rows)):
        size = rows[i] @ by[i]
        moves = size > RANK * largest
        part = moves / ca.if_else(moves, size, 1)  # its derivatives are finite too
        free = free - by[i] * (part * (rows[i] @ free - aims[i]))
        for j in range(i + 1, len(rows)):
            share = part * (rows[j] @ by[i])
            rows[j], by[j] = rows[j] - share * rows[i], by[j] - share * by[i]
            aims[j] = aims[j] - share * aims[i]
    return free
