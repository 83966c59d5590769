"""Bite force: motion in the free directions, force along the bite, switched by contact.

Free, this is computed torque that bears the measured force f on the food as well. Biting, with u
the direction of the bite and J (1, m) the Jacobian of the point's velocity along it,

    F     = f_w + proportional (f_w - f) + integral int (f_w - f) dt,    f_w = share f_d,
    q_c'' = N (q_d'' + Kv (q_d' - q') + Kp (q_d - q)) - J^# bite_damping J q',
    effort = inverse dynamics of (q, q', q_c'') that also bears -F u at the point,
    J^# = M^-1 J^T (J M^-1 J^T)^-1,    N = 1 - J^# J:

hybrid control of position and force (Raibert and Craig, J. Dyn. Sys. Meas. Control 103 (1981)
126-133) with the dynamically consistent projection of Khatib, IEEE J. Robotics and Automation 3
(1987) 43-53. Along u the jaw then is a mass 1 / (J M^-1 J^T) on the food's spring, which
`bite_damping` has to calm: critical damping is 2 sqrt((1 + proportional) stiffness / mass).

The force wanted, f_w, rises in `rise` from what is felt at touch to f_d; its error is integrated
from then on: a step would leave the jaw's momentum to the food, and the integral all it gives way.
While limits cut an effort, the integral does not grow.

A bite begins where f passes `threshold` while the path closes. It ends where f falls below half of
that, or where the path has opened by `release` beyond where the point is; then the jaw follows the
path, and bites no more until it has left the food. So `motion` says when to bite, and `force` how
hard. Since f is borne all the time, efforts do not jump where one law follows the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ...dynamics.least_norm import definite_solve
from ...mechanism.quantities import Direction, LoadPoint, NonNegativeLength
from ..builder import Lanes
from ..entries import File, Gain, Machine, Positive
from .computed_torque import ComputedTorque, corrected
from .controller import Control

FREE, BITING, LEAVING = 0.0, 1.0, 2.0


class BiteForce(ComputedTorque):
    """Computed torque that changes to a bite of given force where the teeth meet food.

    Memory: FREE, BITING or LEAVING, the integral of the error [N s], and the share of f_d that is
    wanted.
    """

    ports: ClassVar[Mapping[str, str | int]] = {
        **ComputedTorque.ports,
        "point": 3,
        "direction": 3,
        "proportional": 1,
        "integral": 1,
        "bite_damping": 1,
        "threshold": 1,
        "release": 1,
        "rise": 1,
    }
    memory: ClassVar[tuple[float, ...]] = (FREE, 0.0, 0.0)
    holding: ClassVar[tuple[float, ...] | None] = (BITING, 0.0, 1.0)
    resting: ClassVar[tuple[float, ...] | None] = (LEAVING, 0.0, 0.0)
    parameters: ClassVar[Mapping[str, str]] = {
        **ComputedTorque.parameters,
        "force": "N",
        "proportional": "1",
        "integral": "1/s",
        "bite_damping": "1/s",
        "threshold": "N",
    }

    kind: Literal["bite_force"]  # type: ignore[assignment]
    point: LoadPoint | None = Field(default=None, description="that bites; default right_molar")
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
    rise: Gain = Field(default=0.1, description="from touch to f_d, s; 0: at once")

    @model_validator(mode="after")
    def _one_force(self) -> BiteForce:
        if (self.force is None) == (self.force_file is None):
            raise ValueError("expected force [N] or force_file (CSV of t, force), one of them")
        return self

    def place(self, machine: Machine) -> str | None:
        return machine.place(self.point)

    @staticmethod
    def held_forces(
        numbers: Mapping[str, np.ndarray], force: float
    ) -> tuple[np.ndarray, np.ndarray]:
        return numbers["direction"][None], np.array([force])

    @staticmethod
    def equations(c: Control) -> tuple[Lanes, ca.SX]:
        now, ref, g = c.measured, c.reference, c.gains
        J = g.direction.T @ c.point(now.q, g.point).J
        measured = -ca.dot(g.direction, now.force)
        mode, total, share = ca.vertsplit(c.memory)
        mode = next_mode(c, mode, measured, J @ (ref.q - now.q), J @ ref.q1)
        biting = mode == BITING
        M = c.inertia(now.q)
        by = definite_solve(M, J.T, ca.diag(M))[0]
        q2 = corrected(c)
        approach = (J @ q2 + g.bite_damping * (J @ now.q1)) / (J @ by)
        part = ca.if_else(g.rise > 0, c.period / g.rise, 1)
        share = ca.fmin(share + part, 1)
        wanted = share * ref.force
        error = wanted - measured
        push = wanted + g.proportional * error + g.integral * total
        push = ca.if_else(biting, push, measured)
        effort = c.inverse(
            now.q, now.q1, q2 - ca.if_else(biting, approach, 0) * by, -push * g.direction, g.point
        )
        grows = (share >= 1) * (1 - c.cut(effort) * (error * total >= 0))
        total = ca.if_else(biting, total + grows * error * c.period, 0)
        begins = ca.fmin(ca.fmax(measured / ca.if_else(ref.force > 0, ref.force, 1), 0), 1)
        return effort, ca.vertcat(mode, total, ca.if_else(biting, share, begins))


def next_mode(c: Control, mode: ca.SX, measured: ca.SX, ahead: ca.SX, closing: ca.SX) -> ca.SX:
    """Which law is next.

    Args: measured: force on the food [N];  ahead: how much further the path is into it [m];
          closing: how fast the path goes that way [m/s].
    """
    g = c.gains
    lets_go = ca.logic_and(ahead < -g.release, closing < 0)
    begins = ca.logic_and(mode == FREE, ca.logic_and(measured > g.threshold, closing > 0))
    biting = ca.if_else(lets_go, LEAVING, BITING)
    touching = ca.if_else(mode == BITING, biting, ca.if_else(begins, BITING, mode))
    return ca.if_else(measured < g.threshold / 2, FREE, touching)
