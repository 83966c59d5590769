"""What is checked after every step: guards that must stay below zero, and where one passed it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .events import CHATTER, LIMITS
from .integrators import IntegrationStep
from .plan import Plan
from .plant import Guard, Plant

TOLERANCE = 1e-12  # seconds, of the time of an event
HALVES = 40  # of a step, down to rounding
MODES = 3  # of a load, at most, that follow one another at once
SUDDEN = 1e-9  # m, N, rad/s or m/s beyond zero: not rounding


@dataclass(frozen=True)
class Crossing:
    """A guard that passed zero, when and where."""

    time: float
    state: np.ndarray
    guard: Guard


class RunGuards:
    """The guards of runs: bounds, pulls of unilateral contacts, speeds, and the loads' own.

    Python looks at those of the first run, compiled code at all. A limit that was met within
    `CHATTER` is counted at the end of a step, which goes on.

    limit: (guards,), whether it is one that may chatter.
    past:  (guards, runs), whether each is beyond zero already; loads' never are.
    met:   (guards, runs), when it last was [s];  again: how often since that was last asked.
    """

    def __init__(
        self, plan: Plan, plant: Plant, evaluate: Callable[[float, np.ndarray], None], runs: int
    ) -> None:
        """Args: evaluate: a state, with the efforts that act there."""
        self._plant, self._evaluate = plant, evaluate
        self.change(plan)
        shape = len(self.guards), runs
        self.past: np.ndarray = np.zeros(shape, dtype=bool)
        self.limit: np.ndarray = np.array([g.kind in LIMITS for g in self.guards], dtype=bool)
        # Of two that are met at once, the second is beyond zero by rounding where a step begins.
        self._zero = np.where(self.limit, SUDDEN, 0.0)
        self.met: np.ndarray = np.full(shape, -np.inf)
        self.again: np.ndarray = np.zeros(shape, dtype=np.int64)

    def change(self, plan: Plan) -> None:
        """Other numbers in the loads."""
        self.guards: list[Guard] = self._plant.guards(plan)
        self._rows = np.array([guard.row for guard in self.guards], dtype=int)
        self._own = np.array(
            [g.load is None and g.contact is None and not g.flank for g in self.guards], dtype=bool
        )

    def _values(self, t: float, y: np.ndarray) -> np.ndarray:
        self._evaluate(t, y)
        return self._plant.columns.found[self._rows, 0]

    def begin(self, t: float, y: np.ndarray) -> list[Crossing]:
        """The guards' values to begin with, and what efforts that jumped did at once."""
        self._before = values = self._values(t, y)
        past = self.past[:, 0]
        sudden = np.flatnonzero((values > SUDDEN) & ~past & self._own)
        past[:] = self._own & ((values > self._zero) | (past & (values > -SUDDEN)))
        self.met[sudden, 0] = t
        return [Crossing(t, y, self.guards[i]) for i in sudden]

    def crossing(self, step: IntegrationStep) -> Crossing | None:
        """The first guard that passes zero within a step, if any."""
        after = self._values(step.t1, step.y1)
        before, self._before = self._before, after
        past, met = self.past[:, 0], self.met[:, 0]
        passed = (after > 0) & (before <= self._zero) & ~past
        chatters = passed & self.limit & (step.t1 - met < CHATTER)
        others = np.flatnonzero(passed & ~chatters)
        if not others.size:
            past[:] = self._own & (after > 0)
            met[chatters] = step.t1
            self.again[chatters, 0] += 1
            return None
        t, first = min((self._when(step, int(i)), int(i)) for i in others)
        past[first], met[first] = self._own[first], t
        return Crossing(t, step.y1 if t == step.t1 else step.at(t), self.guards[first])

    def overtaken(self, t: float, y: np.ndarray, modes: Sequence[int]) -> list[Crossing]:
        """What loads do at once whose numbers have changed, each until nothing more happens."""
        crossings, modes = [], list(modes)
        for _ in range(MODES):
            self._plant.set_modes(modes)
            over = self._values(t, y) > 0
            passed = [g for g, on in zip(self.guards, over, strict=True) if on]
            # The first of each load.
            first = {g.load: g for g in reversed(passed) if g.load is not None}
            if not first:
                break
            for i, guard in sorted(first.items()):
                modes[i] = guard.mode
                crossings.append(Crossing(t, y, guard))
        return crossings

    def _when(self, step: IntegrationStep, i: int) -> float:
        """Time at which guard i passes zero, by bisection with secants (Brent)."""
        from scipy.optimize import brentq

        def value(t: float) -> float:
            return float(self._values(t, step.at(t))[i])

        start = step.t0
        ends = value(start), value(step.t1)
        if ends[0] >= 0 < ends[1]:
            # What leaves zero with the step, as a speed from rest, may pass it on its way back.
            halves = (step.t0 + (step.t1 - step.t0) * 0.5**k for k in range(1, HALVES))
            start = next((t for t in halves if value(t) < 0), start)
            ends = value(start), ends[1]
        if not ends[0] < 0 < ends[1]:
            return step.t0 if ends[0] >= 0 else step.t1
        # The event has happened, by more than rounding: whoever goes on does not meet it again.
        t, on = float(brentq(value, start, step.t1, xtol=TOLERANCE, rtol=1e-15)), TOLERANCE
        t = min(t + on, step.t1)
        while t < step.t1 and value(t) <= 0:
            t, on = min(t + on, step.t1), 2 * on
        return t
