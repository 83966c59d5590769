"""Rotors that grip and turn during a run: which break away, which come to rest, and how they go on.

As `condyle.simulation.sticking`, for the static friction of drives: each is one-dimensional, and no
other feels which of them grips but by the state.
"""

from __future__ import annotations

import numpy as np

from ..results.contact_lifts import ContactLift
from .integrators import IntegrationStep
from .lifting import Change, Evaluate
from .plan import Plan
from .plant import Guard, Plant
from .sticking import EXCESS
from .watch import Crossing


class GrippingDrives:
    """The drives with static friction of one run.

    active: (g,), whose rotors grip.
    """

    def __init__(self, plan: Plan, plant: Plant, evaluate: Evaluate) -> None:
        """Args: evaluate: a state, with the efforts that act there."""
        self._plant, self._evaluate = plant, evaluate
        self._some = np.array(plan.gripping)
        self._names = [plan.model.mechanism.chain_names[i] for i in self._some]
        self._rates = plant.lags["motor_rate"][self._some]  # in the state
        self._count = len(plan.low)
        self.active: np.ndarray = np.zeros(len(self._some), dtype=bool)
        self._direction = np.zeros(len(self._some))

    def projected(self, t: float, y: np.ndarray) -> np.ndarray:
        """The state as it is: rotors grip by their accelerations."""
        return y

    def note(self, t: float, changes: list[Change]) -> None:
        """Nothing: no contact opens."""

    def lifts(self, t: float) -> dict[str, ContactLift]:
        """Lifts of contacts, by name, at the end of the run: none."""
        return {}

    def landing(self, step: IntegrationStep, first: Crossing | None) -> Crossing | None:
        """What happens first: guards say it all."""
        return first

    def changes_at_once(self, t: float, y: np.ndarray) -> bool:
        """Whether efforts that jumped let one break away."""
        self._evaluate(t, y)
        return bool((self._of("drive_slips") > EXCESS).any())

    def begin(self, y: np.ndarray) -> None:
        """What is at rest grips, until the first efforts say whether it can."""
        self._direction[:] = np.sign(y[self._rates])
        self.active[:] = self._direction == 0
        self._set()

    def settled(
        self, t: float, y: np.ndarray, guard: Guard | None = None
    ) -> tuple[np.ndarray, list[Change]]:
        """The state from here on, and what happened to rotors."""
        before, y = self.active.copy(), y.copy()
        if guard is not None and guard.contact is not None:
            if guard.kind == "drive_sticks":
                y[self._rates[guard.contact]] = 0.0
                self.active[guard.contact] = True
                self._set()
            else:
                self._evaluate(t, y)
                self._let_go(guard.contact)
        for _ in self._some:
            self._evaluate(t, y)
            slips = self._of("drive_slips")
            if slips.max() <= EXCESS:
                break
            self._let_go(int(slips.argmax()))
        named = list(enumerate(self._names)) if t > 0 else []
        changed = [(i, name) for i, name in named if before[i] != self.active[i]]
        kinds = {True: ("drive_sticks", "sticks"), False: ("drive_slips", "breaks away")}
        return y, [Change(*kinds[bool(self.active[i])], name) for i, name in changed]

    def _of(self, result: str) -> np.ndarray:
        return self._plant[result][self._some]

    def _let_go(self, rotor: int) -> None:
        """A rotor turns as it was pulled when the plant was evaluated."""
        self._direction[rotor] = np.sign(self._of("drive_pull")[rotor])
        self.active[rotor] = False
        self._set()

    def _set(self) -> None:
        for port, values in (("grips", self.active), ("turn_direction", self._direction)):
            every = np.zeros(self._count)
            every[self._some] = values
            self._plant.columns.fill(port, [every])
