"""An objective of one's own: its cost with two derivatives, and the line that registers it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from condyle.distribution import Objective, register


@dataclass(frozen=True)
class Quartic(Objective):
    """Sum of fourth powers of efforts over their limits."""

    curved: ClassVar[bool] = True

    @staticmethod
    def cost(x: np.ndarray) -> np.ndarray:
        return x**4 / 4

    @staticmethod
    def slope(x: np.ndarray) -> np.ndarray:
        return x**3

    @staticmethod
    def curvature(x: np.ndarray) -> np.ndarray:
        return 3 * x * x


def add() -> None:
    register(Quartic("quartic", "minimum sum of fourth powers of activations", mixes_units=True))
