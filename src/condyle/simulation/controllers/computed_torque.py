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
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...model.evaluator import Evaluator
from ..table import Gain, Gains
from .base import ControllerTable, Law, Measured, Memory, Reference, each


class ComputedTorque(ControllerTable):
    """The model's inverse dynamics, and springs and dampers on what it leaves over."""

    kind: Literal["computed_torque"]
    stiffness: Gains = Field(description="Kp [1/s^2]; one, or one a coordinate")
    damping: Gain | tuple[Gain, ...] | None = Field(
        default=None, description="Kv [1/s]; default 2 sqrt(Kp)"
    )

    def bind(self, model: Evaluator) -> Law:
        return ComputedTorqueLaw(model, *motion_gains(self.stiffness, self.damping, model))


@dataclass(frozen=True)
class ComputedTorqueLaw(Law):
    knobs: ClassVar[Mapping[str, str]] = {"stiffness": "1/s²", "damping": "1/s"}

    stiffness: np.ndarray
    damping: np.ndarray

    def acceleration(self, now: Measured, aim: Reference) -> np.ndarray:
        """q_c'', (m,)."""
        return aim.q2 + self.damping * (aim.q1 - now.q1) + self.stiffness * (aim.q - now.q)

    def __call__(self, now: Measured, aim: Reference, memory: Memory) -> tuple[np.ndarray, Memory]:
        return self.model.one(now.q, now.q1, self.acceleration(now, aim), np.zeros(9)), memory


def motion_gains(
    stiffness: float | tuple[float, ...],
    damping: float | tuple[float, ...] | None,
    model: Evaluator,
) -> tuple[np.ndarray, np.ndarray]:
    """Kp and Kv, (m,) each; critical damping where none is said."""
    names = model.independent
    Kp = each(stiffness, len(names), "stiffness", names)
    Kv = 2 * np.sqrt(Kp) if damping is None else each(damping, len(names), "damping", names)
    return Kp, Kv
