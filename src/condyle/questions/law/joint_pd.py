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
from typing import ClassVar, Literal

import casadi as ca
from pydantic import Field

from ..builder import Lanes
from ..entries import Gains
from .controller import EACH_CHAIN, Control, ControllerTable


class JointPD(ControllerTable):
    """A servo drive at every joint."""

    ports: ClassVar[Mapping[str, str | int]] = {"stiffness": EACH_CHAIN, "damping": EACH_CHAIN}
    parameters: ClassVar[Mapping[str, str]] = {
        "stiffness": "N m/rad or N/m",
        "damping": "N m s/rad or N s/m",
    }
    adds: ClassVar[bool] = True
    chooses: ClassVar[tuple[str, ...]] = ("gravity",)

    kind: Literal["joint_pd"]
    stiffness: Gains = Field(description="N m/rad or N/m; one, or one a chain")
    damping: Gains = Field(description="N m s/rad or N s/m")
    gravity: bool = Field(default=True, description="add what holds the reference at rest")

    @staticmethod
    def equations(c: Control) -> tuple[Lanes, ca.SX]:
        now, ref, g = c.measured, c.reference, c.gains
        still = ca.SX.zeros(ref.q.numel())
        held = c.inverse(ref.q, still, still) if c.choices["gravity"] else [0] * len(now.joint)
        return [
            held[i]
            + g.stiffness[i] * (ref.joint[i] - now.joint[i])
            + g.damping[i] * (ref.joint_rate[i] - now.joint_rate[i])
            for i in range(len(now.joint))
        ], c.memory
