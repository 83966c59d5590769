"""A quantity of one's own: its row, with its equation of solutions; and a question that has it."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from condyle.export.catalogue import CATALOGUE, CEntry
from condyle.quantities import Quantity, register
from condyle.questions import QUESTIONS
from condyle.questions.builder import Builder
from condyle.questions.platform import closed


def written(structure: Any) -> Any:
    """Speed of O_M, from q and q1."""
    b = Builder(structure)
    b.output("platform_speed", ca.norm_2(closed(b).motion.twist[:3]), "m/s")
    return b.finish()


def add() -> None:
    register(
        Quantity(
            "platform_speed",
            "time",
            "m/s",
            "speed of the platform's origin",
            column="platform_speed",
            equation=lambda d: np.linalg.norm(d.evaluation.pose_rate[:, :3], axis=1),
            figure="motion",
        )
    )
    QUESTIONS["platform_speed"] = written
    CATALOGUE["platform_speed"] = CEntry("Speed of the platform.", "q q1", "platform_speed")
