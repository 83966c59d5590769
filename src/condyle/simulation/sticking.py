"""Static friction during a run: what slips, what stops, and which way it goes on."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ..results.contact_lifts import ContactLift
from .integrators import IntegrationStep
from .lifting import FRICTION_WORK, Change, Evaluate
from .plan import Plan
from .plant import Guard, Plant
from .watch import Crossing

STILL = 1e-9  # of the smoothing speed: it is at rest
EXCESS = 1e-12  # of what static friction bears: rounding


class StaticFriction:
    """What static friction holds during one run: contacts, or rotors.

    active: (s,), which of them are held.
    slips, sticks: the events of one that lets go, or comes to rest, and their words.
    """

    slips: ClassVar[tuple[str, str]]
    sticks: ClassVar[tuple[str, str]]

    def __init__(self, names: Sequence[str], plant: Plant, evaluate: Evaluate) -> None:
        """Args: evaluate: a state, with the efforts that act there."""
        self._names, self._plant, self._evaluate = names, plant, evaluate
        self.active: np.ndarray = np.zeros(len(names), dtype=bool)

    def projected(self, t: float, y: np.ndarray) -> np.ndarray:
        """The state as it is: what holds does so by its accelerations."""
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
        """Whether efforts that jumped let one go."""
        self._evaluate(t, y)
        return bool((self._excess() > EXCESS).any())

    def settled(
        self, t: float, y: np.ndarray, guard: Guard | None = None
    ) -> tuple[np.ndarray, list[Change]]:
        """The state from here on, and what happened."""
        before, y = self.active.copy(), y.copy()
        if guard is not None and guard.contact is not None:
            if guard.kind == self.sticks[0]:
                y = self._stopped(t, y, guard.contact)
            else:
                self._evaluate(t, y)
                self._let_go(guard.contact)
        for _ in self._names:
            self._evaluate(t, y)
            excess = self._excess()
            if excess.max() <= EXCESS:
                break
            self._let_go(int(excess.argmax()))
        named = list(enumerate(self._names)) if t > 0 else []
        changed = [(i, name) for i, name in named if before[i] != self.active[i]]
        return y, [
            Change(*(self.sticks if self.active[i] else self.slips), name) for i, name in changed
        ]

    @abstractmethod
    def begin(self, y: np.ndarray) -> None:
        """What is at rest is held, until the first efforts say whether it can be."""

    @abstractmethod
    def _excess(self) -> np.ndarray:
        """What each that is held bears beyond what it can, as a part of it, (s,)."""

    @abstractmethod
    def _stopped(self, t: float, y: np.ndarray, one: int) -> np.ndarray:
        """The state where one has come to rest, and is held."""

    @abstractmethod
    def _let_go(self, one: int) -> None:
        """Let one go, against what it bore when the plant was evaluated."""


class StickingContacts(StaticFriction):
    """The contacts with static friction of one run."""

    slips, sticks = ("contact_slips", "slips"), ("contact_sticks", "sticks")

    def __init__(self, plan: Plan, plant: Plant, evaluate: Evaluate) -> None:
        names = plan.model.mechanism.contact_names
        super().__init__([names[i] for i in plan.sticking], plant, evaluate)
        self._some, self._m = plan.sticking, len(plan.q)
        contacts = plan.model.mechanism.contacts
        self._slow = np.array([contacts[i].friction.smoothing_speed for i in self._some])
        self._direction = np.zeros((len(self._some), 3))

    def begin(self, y: np.ndarray) -> None:
        """As of `StaticFriction`."""
        self._plant.evaluate(0.0, y)
        slip, speed = self._sliding()
        self.active[:] = speed <= STILL * self._slow
        moving = ~self.active
        self._direction[moving] = slip[moving] / speed[moving, None]
        self._set()

    def _sliding(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities where they touch, (s, 3), and their sizes."""
        slip = self._plant["slip"].reshape(-1, 3)[list(self._some)]
        return slip, np.linalg.norm(slip, axis=1)

    def _excess(self) -> np.ndarray:
        guards = self._plant["guards"][-2 * len(self._some) :]
        return guards[: len(self._some)]

    def _stopped(self, t: float, y: np.ndarray, one: int) -> np.ndarray:
        """As of `StaticFriction`; others may stop with it."""
        self.active[one] = True
        self._set()
        self._evaluate(t, y)
        *change, lost = self._plant["stopped"]
        y[self._m : 2 * self._m] += change
        y[2 * self._m + FRICTION_WORK] += lost
        self._evaluate(t, y)
        self.active |= self._sliding()[1] <= STILL * self._slow
        self._set()
        return y

    def _let_go(self, one: int) -> None:
        """As of `StaticFriction`."""
        hold = self._plant["hold"].reshape(-1, 3)[one]
        self._direction[one] = -hold / np.linalg.norm(hold)
        self.active[one] = False
        self._set()

    def _set(self) -> None:
        self._plant.columns.fill("stuck", [self.active.astype(float)])
        self._plant.columns.fill("slip_direction", [self._direction.ravel()])
