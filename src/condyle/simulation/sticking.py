"""Contacts that stick and slide during a run: what slips, what stops, and which way it goes on."""

from __future__ import annotations

import numpy as np

from ..results.contact_lifts import ContactLift
from .integrators import IntegrationStep
from .lifting import FRICTION_WORK, Change, Evaluate
from .plan import Plan
from .plant import Guard, Plant
from .watch import Crossing

STILL = 1e-9  # of the smoothing speed: it is at rest
EXCESS = 1e-12  # of what static friction bears: rounding


class StickingContacts:
    """The contacts with static friction of one run.

    active: (s,), which stick.
    """

    def __init__(self, plan: Plan, plant: Plant, evaluate: Evaluate) -> None:
        """Args: evaluate: a state, with the efforts that act there."""
        self._plant, self._evaluate, self._m = plant, evaluate, len(plan.q)
        self._some = plan.sticking
        self._names = [plan.model.mechanism.contact_names[i] for i in self._some]
        count, contacts = len(self._some), plan.model.mechanism.contacts
        self._slow = np.array([contacts[i].friction.smoothing_speed for i in self._some])
        self.active: np.ndarray = np.zeros(count, dtype=bool)
        self._direction = np.zeros((count, 3))

    def projected(self, t: float, y: np.ndarray) -> np.ndarray:
        """The state as it is: contacts that stick do so by their accelerations."""
        return y

    def note(self, t: float, changes: list[Change]) -> None:
        """Nothing: contacts that stick and slip stay closed."""

    def lifts(self, t: float) -> dict[str, ContactLift]:
        """Lifts of contacts, by name, at the end of the run: none."""
        return {}

    def landing(self, step: IntegrationStep, first: Crossing | None) -> Crossing | None:
        """What happens first: guards say it all."""
        return first

    def changes_at_once(self, t: float, y: np.ndarray) -> bool:
        """Whether efforts that jumped let one slip."""
        self._evaluate(t, y)
        return bool((self._slips() > EXCESS).any())

    def begin(self, y: np.ndarray) -> None:
        """What is at rest sticks, until the first efforts say whether it can."""
        self._plant.evaluate(0.0, y)
        slip, speed = self._sliding()
        self.active[:] = speed <= STILL * self._slow
        moving = ~self.active
        self._direction[moving] = slip[moving] / speed[moving, None]
        self._set()

    def settled(
        self, t: float, y: np.ndarray, guard: Guard | None = None
    ) -> tuple[np.ndarray, list[Change]]:
        """The state from here on, and what happened to contacts."""
        before, y = self.active.copy(), y.copy()
        if guard is not None and guard.contact is not None:
            if guard.kind == "contact_sticks":
                y = self._stopped(t, y, guard.contact)
            else:
                self._evaluate(t, y)
                self._let_go(guard.contact)
        for _ in self._some:
            self._evaluate(t, y)
            slips = self._slips()
            if slips.max(initial=-1.0) <= EXCESS:
                break
            self._let_go(int(slips.argmax()))
        named = list(enumerate(self._names)) if t > 0 else []
        changed = [(i, name) for i, name in named if before[i] != self.active[i]]
        kinds = {True: ("contact_sticks", "sticks"), False: ("contact_slips", "slips")}
        return y, [Change(*kinds[bool(self.active[i])], name) for i, name in changed]

    def _sliding(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities where they touch, (s, 3), and their sizes."""
        slip = self._plant["slip"].reshape(-1, 3)[list(self._some)]
        return slip, np.linalg.norm(slip, axis=1)

    def _slips(self) -> np.ndarray:
        guards = self._plant["guards"][-2 * len(self._some) :]
        return guards[: len(self._some)]

    def _stopped(self, t: float, y: np.ndarray, contact: int) -> np.ndarray:
        """The state where a contact has come to rest, and sticks."""
        self.active[contact] = True
        self._set()
        self._evaluate(t, y)
        *change, lost = self._plant["stopped"]
        y[self._m : 2 * self._m] += change
        y[2 * self._m + FRICTION_WORK] += lost
        self._evaluate(t, y)
        self.active |= self._sliding()[1] <= STILL * self._slow  # others stop with it
        self._set()
        return y

    def _let_go(self, contact: int) -> None:
        """A contact slips, against what it bore when the plant was evaluated."""
        hold = self._plant["hold"].reshape(-1, 3)[contact]
        self._direction[contact] = -hold / np.linalg.norm(hold)
        self.active[contact] = False
        self._set()

    def _set(self) -> None:
        self._plant.columns.fill("stuck", [self.active.astype(float)])
        self._plant.columns.fill("slip_direction", [self._direction.ravel()])
