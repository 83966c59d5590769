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
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...model.evaluator import Evaluator
from ...motion import resolve_load_point
from ..point import Instant
from ..table import Gain, Gains, Name
from .base import ControllerTable, Law, Measured, Memory, Reference, each

RANK = 1e-10  # of the point's inverse inertia, beside its largest: below, it cannot move that way


class Impedance(ControllerTable):
    """A spring and a damper at a point of the platform."""

    kind: Literal["impedance"]
    point: Name | None = Field(default=None, description="of the platform; default right_molar")
    stiffness: Gains = Field(description="N/m; one, or along x, y, z of {S}")
    damping: Gains = Field(description="N s/m")
    posture: Gain = Field(default=400.0, description="Kp of the other freedoms, 1/s^2")
    posture_damping: Gain | None = Field(default=None, description="1/s; default 2 sqrt(posture)")

    def bind(self, model: Evaluator) -> Law:
        name = resolve_load_point(self.point, model.mechanism.platform.points)
        Kn = self.posture
        return ImpedanceLaw(
            model,
            each(self.stiffness, 3, "stiffness", "xyz"),
            each(self.damping, 3, "damping", "xyz"),
            Kn,
            2 * Kn**0.5 if self.posture_damping is None else self.posture_damping,
            Instant(model, inertia=True),
            point=model.load_point(name),
            place=name,
        )


@dataclass(frozen=True)
class ImpedanceLaw(Law):
    knobs: ClassVar[Mapping[str, str]] = {
        "stiffness": "N/m", "damping": "N s/m", "posture": "1/s²", "posture_damping": "1/s",
    }  # fmt: skip

    stiffness: np.ndarray
    damping: np.ndarray
    posture: float
    posture_damping: float
    instant: Instant

    def __call__(self, now: Measured, aim: Reference, memory: Memory) -> tuple[np.ndarray, Memory]:
        at, point = self.instant, self.point
        assert point is not None
        at(aim.q, aim.q1)
        p_d, v_d = at.position(point), at.jacobian(point) @ aim.q1
        at(now.q, now.q1)
        J, M = at.jacobian(point), at["inertia_matrix"]
        force = self.stiffness * (p_d - at.position(point))
        force += self.damping * (v_d - J @ now.q1)
        free = self.posture_damping * (aim.q1 - now.q1) + self.posture * (aim.q - now.q)
        by = np.linalg.solve(M, J.T)
        free -= by @ (np.linalg.pinv(J @ by, rcond=RANK, hermitian=True) @ (J @ free))
        load = np.concatenate([-force, np.zeros(3), point])
        return self.model.one(now.q, now.q1, aim.q2 + free, load), memory
