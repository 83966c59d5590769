"""Computed torque: inverse dynamics of an acceleration that leads back to the path.

    q_c'' = q_d'' + damping (q_d' - q') + stiffness (q_d - q),
    effort = inverse dynamics of (q, q', q_c''),  by the chosen distribution,

in the independent coordinates q_EE. Where the model is right the error obeys e'' + Kv e' + Kp e = 0
whatever the mechanism does: critically damped with the default Kv = 2 sqrt(Kp). (Luh, Walker and
Paul, IEEE Trans. Automatic Control 25 (1980) 468-474; Murray, Li and Sastry, A Mathematical
Introduction to Robotic Manipulation, 1994, section 4.5.)

With a model that is wrong, M'' + .. = effort leaves e'' + Kv e' + Kp e = d, and d bounds the error:
see `condyle.simulation.gains.error_bound`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field

from ..builder import Lanes
from ..entries import Gain, Gains, Machine
from .controller import EACH_COORDINATE, Control, ControllerTable


class ComputedTorque(ControllerTable):
    """The model's inverse dynamics, and springs and dampers on what it leaves over."""

    ports: ClassVar[Mapping[str, str | int]] = {
        "stiffness": EACH_COORDINATE,
        "damping": EACH_COORDINATE,
    }
    parameters: ClassVar[Mapping[str, str]] = {"stiffness": "1/s²", "damping": "1/s"}

    kind: Literal["computed_torque"]
    stiffness: Gains = Field(description="Kp [1/s^2]; one, or one a coordinate")
    damping: Gain | tuple[Gain, ...] | None = Field(
        default=None, description="Kv [1/s]; default 2 sqrt(Kp)"
    )

    def numbers(self, machine: Machine) -> Mapping[str, Any]:
        found = super().numbers(machine)
        critical = 2 * np.sqrt(found["stiffness"])
        return {**found, "damping": critical} if self.damping is None else found

    @staticmethod
    def equations(c: Control) -> tuple[Lanes, ca.SX]:
        return c.inverse(c.measured.q, c.measured.q1, corrected(c)), c.memory


def corrected(c: Control) -> ca.SX:
    """q_c'', (m,)."""
    now, ref, g = c.measured, c.reference, c.gains
    return ref.q2 + g.damping * (ref.q1 - now.q1) + g.stiffness * (ref.q - now.q)
