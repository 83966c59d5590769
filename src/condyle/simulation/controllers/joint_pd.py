"""Independent joints: a spring and a damper between every joint and where it should be.

    effort = stiffness (theta_d - theta) + damping (theta_d' - theta'),

the proportional-derivative law of every servo drive; that it is stable for any positive gains once
gravity is compensated is shown by Takegaki and Arimoto, J. Dyn. Sys. Meas. Control 103 (1981)
119-125. With `gravity`, what holds the reference at rest is added, from the controller's model and
by its distribution. With more actuators than freedoms, joints that disagree work against each
other: gains should be alike. A cable takes no push: it slackens where the law asks for one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...model.evaluator import Evaluator
from ..table import Gains
from .base import ControllerTable, Law, Measured, Memory, Reference, each


class JointPD(ControllerTable):
    """A servo drive at every joint."""

    kind: Literal["joint_pd"]
    stiffness: Gains = Field(description="N m/rad or N/m; one, or one a chain")
    damping: Gains = Field(description="N m s/rad or N s/m")
    gravity: bool = Field(default=True, description="add what holds the reference at rest")

    def bind(self, model: Evaluator) -> Law:
        names = model.mechanism.chain_names
        n = len(names)
        return JointPDLaw(
            model,
            each(self.stiffness, n, "stiffness", names),
            each(self.damping, n, "damping", names),
            self.gravity,
        )


@dataclass(frozen=True)
class JointPDLaw(Law):
    knobs: ClassVar[Mapping[str, str]] = {
        "stiffness": "N m/rad or N/m", "damping": "N m s/rad or N s/m",
    }  # fmt: skip

    stiffness: np.ndarray
    damping: np.ndarray
    gravity: bool

    def __call__(self, now: Measured, aim: Reference, memory: Memory) -> tuple[np.ndarray, Memory]:
        effort = self.stiffness * (aim.joint - now.joint)
        effort += self.damping * (aim.joint_rate - now.joint_rate)
        if self.gravity:
            still = np.zeros_like(aim.q)
            effort += self.model.one(aim.q, still, still, np.zeros(9))
        return effort, memory
