"""Rotors that grip and turn during a run: which break away, which come to rest, and how they go on.

As `condyle.simulation.sticking`, for the static friction of drives: each is one-dimensional, and no
other feels which of them grips but by the state.
"""

from __future__ import annotations

import numpy as np

from .lifting import Evaluate
from .plan import Plan
from .plant import Plant
from .sticking import StaticFriction


class GrippingDrives(StaticFriction):
    """The drives with static friction of one run."""

    slips, sticks = ("drive_slips", "breaks away"), ("drive_sticks", "sticks")

    def __init__(self, plan: Plan, plant: Plant, evaluate: Evaluate) -> None:
        names = plan.model.mechanism.chain_names
        super().__init__([names[i] for i in plan.gripping], plant, evaluate)
        self._some = np.array(plan.gripping)
        self._rates = plant.lags["motor_rate"][self._some]  # in the state
        self._count = len(plan.low)
        self._direction = np.zeros(len(self._some))

    def begin(self, y: np.ndarray) -> None:
        """As of `StaticFriction`."""
        self._direction[:] = np.sign(y[self._rates])
        self.active[:] = self._direction == 0
        self._set()

    def _excess(self) -> np.ndarray:
        return self._of("drive_slips")

    def _of(self, result: str) -> np.ndarray:
        return self._plant[result][self._some]

    def _stopped(self, t: float, y: np.ndarray, one: int) -> np.ndarray:
        """As of `StaticFriction`."""
        y[self._rates[one]] = 0.0
        self.active[one] = True
        self._set()
        return y

    def _let_go(self, one: int) -> None:
        """As of `StaticFriction`: it turns as it was pulled."""
        self._direction[one] = np.sign(self._of("drive_pull")[one])
        self.active[one] = False
        self._set()

    def _set(self) -> None:
        for port, values in (("grips", self.active), ("turn_direction", self._direction)):
            every = np.zeros(self._count)
            every[self._some] = values
            self._plant.columns.fill(port, [every])
