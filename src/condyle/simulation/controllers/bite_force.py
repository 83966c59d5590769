"""Bite force: motion in the free directions, force along the bite, switched by contact.

Free, this is computed torque that bears the measured force f on the food as well. Biting, with u
the direction of the bite and J (1, m) the Jacobian of the point's velocity along it,

    F     = f_d + proportional (f_d - f) + integral int (f_d - f) dt,
    q_c'' = N (q_d'' + Kv (q_d' - q') + Kp (q_d - q)) - J^# bite_damping J q',
    effort = inverse dynamics of (q, q', q_c'') that also bears -F u at the point,
    J^# = M^-1 J^T (J M^-1 J^T)^-1,    N = 1 - J^# J:

hybrid control of position and force (Raibert and Craig, J. Dyn. Sys. Meas. Control 103 (1981)
126-133) with the dynamically consistent projection of Khatib, IEEE J. Robotics and Automation 3
(1987) 43-53. Along u the jaw then is a mass 1 / (J M^-1 J^T) on the food's spring, which
`bite_damping` has to calm: critical damping is 2 sqrt((1 + proportional) stiffness / mass).

A bite begins where f passes `threshold` while the path closes. It ends where f falls below half of
that, or where the path has opened by `release` beyond where the point is; then the jaw follows the
path, and bites no more until it has left the food. So `motion` says when to bite, and `force` how
hard. Since f is borne all the time, efforts do not jump where one law follows the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from ...model.evaluator import Evaluator
from ...motion import resolve_load_point
from ..loads.spring import unit
from ..point import Instant
from ..table import Direction, File, Gain, Gains, Name, NonNegativeLength, Positive
from .base import ControllerTable, Law, Measured, Memory, Reference
from .computed_torque import ComputedTorqueLaw, motion_gains

FREE, BITING, LEAVING = 0.0, 1.0, 2.0


class BiteForce(ControllerTable):
    """Computed torque that changes to a bite of given force where the teeth meet food."""

    continuous = False

    kind: Literal["bite_force"]
    stiffness: Gains = Field(description="Kp of the motion [1/s^2]; one, or one a coordinate")
    damping: Gain | tuple[Gain, ...] | None = Field(
        default=None, description="Kv [1/s]; default 2 sqrt(Kp)"
    )
    point: Name | None = Field(default=None, description="that bites; default right_molar")
    direction: Direction = Field(default=(0.0, 0.0, 1.0), description="of the bite, in {S}")
    force: Gain | None = Field(default=None, description="f_d, N")
    force_file: File | None = Field(default=None, description="CSV of t [s], force [N], instead")
    proportional: Gain = Field(default=0.0, description="1")
    integral: Gain = Field(default=5.0, description="1/s")
    bite_damping: Gain = Field(default=300.0, description="1/s")
    threshold: Positive = Field(default=2.0, description="force that means contact, N")
    release: NonNegativeLength = Field(
        default=2e-4, description="how far the path opens beyond the point before it lets go"
    )

    @model_validator(mode="after")
    def _one_force(self) -> BiteForce:
        if (self.force is None) == (self.force_file is None):
            raise ValueError("expected force [N] or force_file (CSV of t, force), one of them")
        return self

    def bind(self, model: Evaluator) -> Law:
        name = resolve_load_point(self.point, model.mechanism.platform.points)
        return BiteForceLaw(
            model,
            *motion_gains(self.stiffness, self.damping, model),
            np.array(unit(self.direction)),
            self.proportional,
            self.integral,
            self.bite_damping,
            self.threshold,
            self.release,
            1.0 / (self.rate or 1.0),
            Instant(model, inertia=True),
            point=model.load_point(name),
            place=name,
        )


@dataclass(frozen=True)
class BiteForceLaw(ComputedTorqueLaw):
    """Memory: FREE, BITING or LEAVING, and the integral of the error [N s].

    period: [s], over which the integral grows at a call.
    """

    knobs: ClassVar[Mapping[str, str]] = {
        **ComputedTorqueLaw.knobs,
        "force": "N", "proportional": "1", "integral": "1/s", "bite_damping": "1/s",
        "threshold": "N",
    }  # fmt: skip

    direction: np.ndarray
    proportional: float
    integral: float
    bite_damping: float
    threshold: float
    release: float
    period: float
    instant: Instant

    def begin(self) -> Memory:
        return np.zeros(2)

    def __call__(self, now: Measured, aim: Reference, memory: Memory) -> tuple[np.ndarray, Memory]:
        at, u, point = self.instant, self.direction, self.point
        assert point is not None
        at(now.q, now.q1)
        J = u @ at.jacobian(point)
        felt = -float(u @ now.force)
        mode, total = memory.tolist()
        mode = self._mode(mode, felt, J @ (aim.q - now.q), J @ aim.q1)
        acceleration, push = self.acceleration(now, aim), felt
        if mode == BITING:
            by = np.linalg.solve(at["inertia_matrix"], J)
            by /= J @ by
            acceleration -= by * (J @ acceleration + self.bite_damping * (J @ now.q1))
            error = aim.force - felt
            push = aim.force + self.proportional * error + self.integral * total
            total += error * self.period
        else:
            total = 0.0
        load = np.concatenate([-push * u, np.zeros(3), point])
        effort = self.model.one(now.q, now.q1, acceleration, load)
        return effort, np.array([mode, total])

    def _mode(self, mode: float, felt: float, ahead: float, closing: float) -> float:
        """Which law is next.

        Args: felt: force on the food [N];  ahead: how much further the path is into it [m];
              closing: how fast the path goes that way [m/s].
        """
        if felt < self.threshold / 2:
            return FREE
        if mode == BITING:
            return LEAVING if ahead < -self.release and closing < 0 else BITING
        if mode == FREE and felt > self.threshold and closing > 0:
            return BITING
        return mode
