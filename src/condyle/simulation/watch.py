"""What is watched after every step: guards that must stay below zero, and where one passed it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..kinematics.chain import FAMILIES
from .events import KINDS
from .integrators import Step
from .plan import Plan
from .plant import Plant

TOLERANCE = 1e-12  # seconds, of the time of an event

MODES = 3  # of a load, at most, that follow one another at once
SUDDEN = 1e-9  # m, N, rad/s or m/s beyond zero: not rounding

Acting = Callable[[float, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Crossing:
    """A guard that passed zero.

    load, mode: which load takes which mode, or None.
    """

    time: float
    state: np.ndarray
    kind: str
    text: str
    owner: str
    ends: bool = False
    load: int | None = None
    mode: int = 0


@dataclass(frozen=True)
class _Guard:
    kind: str
    text: str
    owner: str
    ends: bool = False
    load: int | None = None
    mode: int = 0


class Watch:
    """The guards of one run: bounds, pulls of one-sided contacts, speeds, and the loads' own."""

    def __init__(self, plan: Plan, plant: Plant) -> None:
        self._plant, self.loads = plant, plan.loads
        machine = self._machine = plan.model.mechanism
        self._m = len(plan.q)
        self._bounded = [
            i for i, c in enumerate(machine.contacts) if any(c.bounds.entries().values())
        ]
        self._sided = [i for i, c in enumerate(machine.contacts) if c.one_sided]
        self._push = np.array([machine.contacts[i].push for i in self._sided], dtype=float)
        self._quick = np.flatnonzero(np.isfinite(plan.speed))
        self._speed = plan.speed[self._quick]
        self._own = [
            _Guard("bound", KINDS["bound"], machine.contact_names[i], plan.stop_at_bounds)
            for i in self._bounded
        ]
        self._own += [
            _Guard("lift_off", KINDS["lift_off"], machine.contact_names[i], True)
            for i in self._sided
        ]
        for i in self._quick:
            chain = machine.chains[i]
            unit = FAMILIES[chain.kind].joint_unit
            text = f"faster than its limit of {plan.speed[i]:g} {unit}/s"
            self._own.append(_Guard("speed", text, chain.name))
        self.past = np.zeros(len(self._own), dtype=bool)

    @property
    def told(self) -> list[tuple[int, int, float]]:
        """Guards but those of loads, as numbers: kind (bound, lift off, speed), contact or chain,
        and sign of the push or limit."""
        found = [(0, i, 0.0) for i in self._bounded]
        found += [(1, i, p) for i, p in zip(self._sided, self._push.tolist(), strict=True)]
        return found + [
            (2, int(i), v) for i, v in zip(self._quick, self._speed.tolist(), strict=True)
        ]

    def begin(
        self, t: float, y: np.ndarray, modes: Sequence[int], effort: np.ndarray
    ) -> list[Crossing]:
        """The guards' values to begin with, and what efforts that jumped did at once."""
        self._before = values = self._values(t, y, modes, effort)
        own = values[: len(self._own)]
        sudden = np.flatnonzero((own > SUDDEN) & ~self.past)
        self.past[:] = (own > 0) | (self.past & (own > -SUDDEN))
        return [self._crossing(self._own[i], t, y) for i in sudden]

    def crossing(self, step: Step, modes: Sequence[int], acting: Acting) -> Crossing | None:
        """The first guard that passes zero within a step, if any."""
        after = self._values(step.t1, step.y1, modes, acting(step.t1, step.y1))
        before, self._before = self._before, after
        new = (after > 0) & (before <= 0)
        new[: len(self._own)] &= ~self.past
        passed = np.flatnonzero(new)
        if not passed.size:
            self.past[:] = after[: len(self._own)] > 0
            return None
        t, first = min((self._when(step, int(i), modes, acting), int(i)) for i in passed)
        if first < len(self._own):
            self.past[first] = True
        return self._crossing(
            self._guards(modes)[first], t, step.y1 if t == step.t1 else step.at(t)
        )

    def overtaken(self, t: float, y: np.ndarray, modes: Sequence[int]) -> list[Crossing]:
        """What loads do at once whose numbers have changed, each until nothing more happens."""
        self._plant.state(t, y, modes)
        found = []
        for i, (load, mode, (s, v, _)) in enumerate(
            zip(self.loads, modes, self._plant.places(), strict=True)
        ):
            for _ in range(MODES):
                values = load.guards(t, s, v, mode)
                passed = [j for j, g in zip(load.jumps(mode), values, strict=True) if g > 0]
                if not passed:
                    break
                mode = passed[0].mode
                guard = _Guard(passed[0].kind, passed[0].text, load.name, load=i, mode=mode)
                found.append(self._crossing(guard, t, y))
        return found

    @staticmethod
    def _crossing(g: _Guard, t: float, y: np.ndarray) -> Crossing:
        return Crossing(t, y, g.kind, g.text, g.owner, g.ends, g.load, g.mode)

    def _when(self, step: Step, i: int, modes: Sequence[int], acting: Acting) -> float:
        """Time at which guard i passes zero, by bisection with secants (Brent)."""
        from scipy.optimize import brentq

        def value(t: float) -> float:
            y = step.at(t)
            return float(self._values(t, y, modes, acting(t, y))[i])

        ends = value(step.t0), value(step.t1)
        if not ends[0] < 0 < ends[1]:
            return step.t0 if ends[0] >= 0 else step.t1
        # The event has happened, by more than rounding: whoever goes on does not meet it again.
        t, on = float(brentq(value, step.t0, step.t1, xtol=TOLERANCE, rtol=1e-15)), TOLERANCE
        t = min(t + on, step.t1)
        while t < step.t1 and value(t) <= 0:
            t, on = min(t + on, step.t1), 2 * on
        return t

    def _guards(self, modes: Sequence[int]) -> list[_Guard]:
        found = list(self._own)
        for i, (load, mode) in enumerate(zip(self.loads, modes, strict=True)):
            for jump in load.jumps(mode):
                found.append(_Guard(jump.kind, jump.text, load.name, load=i, mode=jump.mode))
        return found

    def _values(
        self, t: float, y: np.ndarray, modes: Sequence[int], effort: np.ndarray
    ) -> np.ndarray:
        plant, m = self._plant, self._m
        wrench = plant.state(t, y, modes)
        values: list[float] = []
        if self._bounded:
            values += (-plant.margins(self._machine)[self._bounded]).tolist()
        if self._sided:
            _, force = plant.accelerate(y[:m], y[m : 2 * m], effort, wrench)
            values += (-self._push * force[self._sided]).tolist()
        if self._quick.size:
            rate = np.abs(plant.last["joint_rate"][self._quick])
            values += (rate - self._speed).tolist()
        if self.loads:
            for load, mode, (s, v, _) in zip(self.loads, modes, plant.places(), strict=True):
                values += load.guards(t, s, v, mode)
        return np.array(values)
