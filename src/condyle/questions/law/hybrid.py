"""Forces along some directions of a task frame at a point, motion along all others.

With D (r, 3) the directions, J = D J_point (r, m) and f the force on what is touched,

    F     = f_w + proportional (f_w - f) + integral int (f_w - f) dt,
    q_c'' = the nearest to q_d'' + Kv (q_d' - q') + Kp (q_d - q) with J q_c'' = -damping J q',
    effort = inverse dynamics of (q, q', q_c'') that also bears -D^T F at the point,

nearest in the metric of the inertia matrix, so that motion makes no force and force no motion
(Raibert and Craig, J. Dyn. Sys. Meas. Control 103 (1981) 126-133; Khatib, IEEE J. Robotics and
Automation 3 (1987) 43-53). Where nothing is touched yet the point goes along D at the speed at
which `force_damping` takes up F; f_w rises to f_d in `rise` from what is felt where the law begins.
While limits cut an effort, the integrals do not grow. `bite_force` is for one direction, and
chooses between both laws by itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ...mechanism.quantities import Direction, LoadPoint
from ..builder import Lanes
from ..entries import Gain, Machine, Signed, each, unit
from .computed_torque import ComputedTorque, corrected
from .controller import Control
from .impedance import led

AXES = 3


class Hybrid(ComputedTorque):
    """Given forces along some directions at a point, computed torque along all others.

    Memory: the integrals of the errors [N s], and the share of f_d that is wanted; where that is
    negative the law is computed torque that bears the force, and begins next time.
    """

    ports: ClassVar[Mapping[str, str | int]] = {
        **ComputedTorque.ports,
        "point": 3,
        "task": AXES * (AXES + 1),
        "proportional": 1,
        "integral": 1,
        "force_damping": 1,
        "rise": 1,
    }
    memory: ClassVar[tuple[float, ...]] = (0.0,) * (AXES + 1)
    holding: ClassVar[tuple[float, ...] | None] = (0.0,) * AXES + (1.0,)
    always_holds: ClassVar[bool] = True
    resting: ClassVar[tuple[float, ...] | None] = (0.0,) * AXES + (-1.0,)
    parameters: ClassVar[Mapping[str, str]] = {
        **ComputedTorque.parameters,
        "proportional": "1",
        "integral": "1/s",
        "force_damping": "1/s",
    }

    kind: Literal["hybrid"]  # type: ignore[assignment]
    point: LoadPoint | None = Field(
        default=None, description="of the platform; default right_molar"
    )
    directions: tuple[Direction, ...] = Field(
        min_length=1, max_length=AXES, description="along which force is given, in {S}"
    )
    forces: Signed = Field(description="f_d on what is touched, N; one, or one a direction")
    proportional: Gain = Field(default=0.0, description="1")
    integral: Gain = Field(default=5.0, description="1/s")
    force_damping: Gain = Field(default=300.0, description="1/s")
    rise: Gain = Field(default=0.1, description="of forces to f_d, s; 0: at once")

    @model_validator(mode="after")
    def _apart(self) -> Hybrid:
        rows = np.array([unit(direction) for direction in self.directions])
        if np.linalg.svd(rows, compute_uv=False)[-1] < 1e-3:
            raise ValueError("directions: expected linearly independent directions")
        return self

    def numbers(self, machine: Machine) -> Mapping[str, Any]:
        """The law's numbers, unused directions and forces 0."""
        count = len(self.directions)
        names = [f"direction {i + 1}" for i in range(count)]
        own = np.zeros(AXES)
        own[:count] = each(self.forces, names, "controller.forces")
        frame = np.zeros((AXES, AXES))
        frame[:count] = [unit(direction) for direction in self.directions]
        return {**super().numbers(machine), "task": np.concatenate([frame.ravel(), own])}

    @property
    def task(self) -> None:
        """Its numbers follow from directions and forces."""

    def place(self, machine: Machine) -> str | None:
        return machine.place(self.point)

    @staticmethod
    def held_forces(
        numbers: Mapping[str, np.ndarray], force: float
    ) -> tuple[np.ndarray, np.ndarray]:
        frame, forces = np.split(numbers["task"], [AXES * AXES])
        frame = frame.reshape(AXES, AXES)
        used = frame.any(axis=1)
        return frame[used], forces[used]

    @staticmethod
    def equations(c: Control) -> tuple[Lanes, ca.SX]:
        now, g = c.measured, c.gains
        D = ca.reshape(g.task[: AXES * AXES], AXES, AXES).T
        forces = g.task[AXES * AXES :]
        J = D @ c.point(now.q, g.point).J
        total, share = c.memory[:AXES], c.memory[AXES]
        rests = share < 0
        share = ca.fmin(share + ca.if_else(g.rise > 0, c.period / g.rise, 1), 1)
        error = share * forces + D @ now.force
        push = share * forces + g.proportional * error + g.integral * total
        q2 = led(corrected(c), J, c.inertia(now.q), -g.force_damping * (J @ now.q1))
        q2 = ca.if_else(rests, corrected(c), q2)
        felt = ca.if_else(rests, now.force, -D.T @ push)
        effort = c.inverse(now.q, now.q1, q2, felt, g.point)
        grows = (share >= 1) * (1 - c.cut(effort) * (error * total >= 0))
        total = total + grows * error * c.period
        return effort, ca.if_else(rests, 0, ca.vertcat(total, share))
