"""Run a plan: from corner to corner, with a look at events after every step."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np

from ..progress import step as progress
from ..status import STATUS_NAMES, Status
from .compiled import BUDGET, DONE, LOOK, PAUSE, STEP, Loop, Side, loop_of
from .controllers import Measured
from .events import KINDS, Event
from .integrators import INTEGRATORS, Stuck
from .loads import BoundLoad
from .plan import ClosedLoop, OpenLoop, Plan, Trace
from .plant import Plant
from .sensing import Lost, Observer
from .watch import Crossing, Watch

ROUNDING = 1e-12  # seconds
CLOSE = 1e-6  # of a step: there already
MANY = 100  # events of a kind and an owner that are listed
SAY = 0.01  # seconds of the simulation between two words of progress


def run(plan: Plan) -> Trace:
    """What happens."""
    with progress("simulating", plan.duration) as advance:
        return Run(plan, advance).trace()


class Run:
    """One run of a plan, under way.

    t, y: where it is [s], and the state there;  modes: of the loads;  events: up to there.
    """

    def __init__(self, plan: Plan, advance: Callable[[float], None] = lambda _: None) -> None:
        self._plan, self._advance = plan, advance
        self._plant = Plant(plan.model, plan.loads)
        self._watch = Watch(plan, self._plant)
        self.modes = list(plan.modes)
        self.events: list[Event] = []
        self._seen: dict[tuple[str, str], int] = {}
        n, count = len(plan.low), len(plan.times)
        self._effort = np.zeros(n)
        self._tick = -1
        self._next = 0
        self._state = np.empty((count, plan.size))
        self._kept_modes = np.zeros((count, len(plan.loads)), dtype=np.int8)
        self._kept_effort = np.empty((count, n))
        self._kept_tick = np.empty(count, dtype=np.int64)
        self._drive = plan.drive
        self._loop = _Loop(plan, self._plant) if isinstance(plan.drive, ClosedLoop) else None
        self._cut = np.zeros(n, dtype=bool)
        self._corners, self._ticks, self._corner = plan.corners(), plan.ticks(), 0
        self._integrator: Any = INTEGRATORS[plan.method](self._rate, plan.settings)
        self.t, self.y = 0.0, np.zeros(plan.size)
        self.y[: 2 * len(plan.q)] = np.concatenate([plan.q, plan.q1])

    def trace(self) -> Trace:
        """Run to the end, or to what ends it."""
        with suppress(Ended):
            self.go_to(self._plan.duration, self.quick())
            self._keep_end(self._plan.duration, self.y)
        return self._trace()

    def go_to(self, until: float, quick: Loop | None) -> None:
        """Run to a time, or to the next step after it [s]; `quick`: of this run, always the same.

        Raises: Ended: where the run is over before.
        """
        if quick is not None:
            self._by_compiled_code(until, quick)
        else:
            self._by_steps(until)

    def change(self, drive: OpenLoop | ClosedLoop, loads: tuple[BoundLoad, ...]) -> None:
        """Go on with other numbers in the law and in the loads, which stay what they are."""
        self._drive = drive
        self._plan = replace(self._plan, drive=drive, loads=loads)
        self._plant.loads = self._watch.loads = loads
        if self._loop is not None:
            assert isinstance(drive, ClosedLoop)
            self._loop.change(drive)
        for crossing in self._watch.overtaken(self.t, self.y, self.modes):
            self._happened(crossing)

    def effort(self) -> np.ndarray:
        """Efforts as they act now, (n,)."""
        return self._acting_here(self.t, self.y).copy()

    def _by_steps(self, until: float) -> None:
        """From corner to corner."""
        corners, ticks, said = self._corners, self._ticks, self.t
        while self.t < until - ROUNDING:
            due = self._tick + 1
            if due < len(ticks) and ticks[due] <= self.t + ROUNDING:
                self._look(self.t, self.y, due)
            corner = float(corners[self._corner + 1])
            end = min(corner, until)
            _, self.y = self._between(self._integrator, self.t, end, self.y)
            self.t = end
            self._corner += end == corner
            if end - said >= SAY:
                self._advance(end - said)
                said = end

    def quick(self) -> Loop | None:
        """The run in compiled code, where there is such a loop for its plan."""
        if self._plan.method != "rk4":
            return None
        results = (self._state, self._kept_effort, self._kept_modes, self._kept_tick)
        side = None if self._loop is None else self._loop.side()
        return loop_of(self._plan, self._watch.told, self._watch.past, results, side)

    def _by_compiled_code(self, until: float, quick: Loop) -> None:
        """The same by `loop.c`, but for what it hands back."""
        step, end = self._plan.settings.step, self._plan.duration
        assert step is not None
        quick.y[:] = self.y
        while True:
            quick.set_modes(self.modes)
            quick.budget = min(max(math.ceil((until - self.t) / step - CLOSE), 1), BUDGET)
            code, said = quick.advance(), self.t
            t, self._next, self._tick = quick.t, quick.next, quick.tick
            self._effort, y, fresh = quick.effort.copy(), quick.y.copy(), False
            self.t, self.y = t, y
            self._advance(t - said)
            if code == DONE or (code == PAUSE and t >= until - CLOSE * step and until < end):
                return
            if code == LOOK:
                self._look(t, y, self._tick + 1)
            elif code == STEP:
                corner = float(self._corners[quick.corner + 1])
                t, y = self._between(self._integrator, t, corner, y, once=True)
                if t >= corner - ROUNDING:
                    quick.corner += 1
                    fresh = True
                self.t, self.y = t, y
            quick.y[:], quick.effort[:], quick.cut[:] = y, self._effort, self._cut
            quick.go_on(t, self._next, self._tick, fresh)

    def _trace(self) -> Trace:
        done, looked, loop = self._next, self._tick + 1, self._loop
        n, m = len(self._effort), len(self._plan.q)
        return Trace(
            self._plan.times[:done],
            self._state[:done],
            self._kept_modes[:done],
            self._kept_effort[:done],
            self._kept_tick[:done],
            np.empty((0, n)) if loop is None else loop.command[:looked],
            np.empty((0, n)) if loop is None else loop.count[:looked],
            np.empty((0, 2 * m)) if loop is None else loop.estimate[:looked],
            np.empty(0) if loop is None else loop.force[:looked],
            tuple(self.events),
        )

    # -- efforts ------------------------------------------------------------------------------

    def _rate(self, t: float, y: np.ndarray) -> np.ndarray:
        plant, drive = self._plant, self._drive
        wrench = plant.state(t, y, self.modes)
        return plant.rate_here(y, self._acting(t, y, drive), wrench)

    def _acting(self, t: float, y: np.ndarray, drive: OpenLoop | ClosedLoop) -> np.ndarray:
        """Efforts at a time, within limits, at the state that was looked at last."""
        if isinstance(drive, OpenLoop):
            effort = np.array([np.interp(t, drive.times, one) for one in drive.efforts.T])
        elif drive.period is None:
            assert self._loop is not None
            effort = self._loop.at_once(t, y, self.modes)
        else:
            return self._effort
        return np.clip(effort, self._plan.low, self._plan.high)

    def _look(self, t: float, y: np.ndarray, k: int) -> None:
        """The controller looks, and what it asked for before comes to act."""
        assert self._loop is not None
        try:
            asked = self._loop.look(t, y, self.modes, k)
        except Lost:
            self._end(t, y, "lost", KINDS["lost"])
        if not np.isfinite(asked).all():
            self._end(t, y, "no_effort", KINDS["no_effort"])
        self._tick = k
        self._effort = np.clip(asked, self._plan.low, self._plan.high)
        self._saturation(t, y, asked)

    def _saturation(self, t: float, y: np.ndarray, asked: np.ndarray) -> None:
        cut = asked != self._effort
        for i in np.flatnonzero(cut & ~self._cut):
            name = self._plan.model.mechanism.chain_names[i]
            text = f"asked for {asked[i]:.4g}, gives {self._effort[i]:.4g}"
            self._note(t, y, "saturated", text, name)
        self._cut = cut

    # -- between two corners ------------------------------------------------------------------

    def _between(
        self, integrator: Any, t: float, until: float, y: np.ndarray, once: bool = False
    ) -> tuple[float, np.ndarray]:
        """Integrate to `until`, or one step; raises Ended where the run is over before."""
        try:
            self._begin(integrator, t, until, y)
            while t < until - ROUNDING:
                step = integrator.step()
                crossing = self._watch.crossing(step, self.modes, self._acting_here)
                end = step.t1 if crossing is None else crossing.time
                self._keep(t, end, step.at)
                t, y = end, step.y1
                if crossing is not None:
                    y = crossing.state
                    self._happened(crossing)
                    if t < until - ROUNDING and not once:
                        self._begin(integrator, t, until, y)
                if once:
                    break
        except Stuck as stuck:
            self._keep_end(t, y)
            kind = "stiff" if stuck.status is None else STATUS_NAMES[stuck.status]
            kind = kind if kind in KINDS else "stiff"
            self._end(t, y, kind, KINDS[kind])
        return t, y

    def _begin(self, integrator: Any, t: float, until: float, y: np.ndarray) -> None:
        integrator.restart(t, y, until)
        effort = self._acting_here(t, y)
        for crossing in self._watch.begin(t, y, self.modes, effort):
            self._happened(crossing)

    def _acting_here(self, t: float, y: np.ndarray) -> np.ndarray:
        self._plant.state(t, y, self.modes)
        return self._acting(t, y, self._drive)

    def _happened(self, crossing: Crossing) -> None:
        t, y = crossing.time, crossing.state
        if crossing.load is not None:
            self.modes[crossing.load] = crossing.mode
        if crossing.ends:
            self._keep_end(t, y)
            self._end(t, y, crossing.kind, crossing.text, crossing.owner)
        elif crossing.kind:
            self._note(t, y, crossing.kind, crossing.text, crossing.owner)

    def _end(self, t: float, y: np.ndarray, kind: str, text: str, owner: str = "") -> NoReturn:
        self._note(t, y, kind, text, owner, ends=True)
        self.t, self.y = t, y
        raise Ended

    def _note(
        self, t: float, y: np.ndarray, kind: str, text: str, owner: str = "", ends: bool = False
    ) -> None:
        names = self._plan.model.independent
        names = (*names, *(f"d{name}" for name in names))
        state = dict(zip(names, y[: len(names)].tolist(), strict=True))
        seen = self._seen[kind, owner] = self._seen.get((kind, owner), 0) + 1
        if seen > MANY and not ends:
            return
        if seen == MANY and not ends:
            text += "; more of these are not listed"
        self.events.append(Event(float(t), kind, text, owner, ends, state))

    # -- what is kept ---------------------------------------------------------------------------

    def _keep(self, t: float, end: float, at: Callable[[float], np.ndarray]) -> None:
        """States at the results' times from t on, before the end."""
        times = self._plan.times
        while self._next < len(times) and times[self._next] < end - ROUNDING:
            when = times[self._next]
            self._keep_one(when, at(max(when, t)))

    def _keep_end(self, t: float, y: np.ndarray) -> None:
        """The last one."""
        times = self._plan.times
        while self._next < len(times) and times[self._next] <= t + ROUNDING:
            self._keep_one(times[self._next], y)

    def _keep_one(self, t: float, y: np.ndarray) -> None:
        i = self._next
        self._state[i], self._kept_modes[i], self._kept_tick[i] = y, self.modes, self._tick
        if isinstance(self._drive, ClosedLoop) and self._drive.period is not None:
            self._kept_effort[i] = self._effort
        else:
            self._kept_effort[i] = self._acting_here(t, y)
        self._next += 1


class Ended(Exception):
    """The run is over; why is among the events."""


class _Loop:
    """The controller's side: sensors, law, and efforts on their way."""

    def __init__(self, plan: Plan, plant: Plant) -> None:
        drive = plan.drive
        assert isinstance(drive, ClosedLoop)
        self._drive, self._plant, m, n = drive, plant, len(plan.q), len(plan.low)
        self._m = m
        self.memory = drive.law.begin().copy()
        ticks = self._ticks = plan.ticks()
        self.aims = drive.path.references(ticks) if len(ticks) else []
        self.command, self.count = (np.empty((len(ticks), n)) for _ in range(2))
        self.estimate, self.force = np.empty((len(ticks), 2 * m)), np.zeros(len(ticks))
        self._rows: np.ndarray | None = None
        self.observer = None
        if drive.sensing is not None and drive.period is not None:
            self.observer = Observer(drive.law.model, drive.sensing, drive.period)
            at = plant.look(plan.q, plan.q1)
            self.observer.begin(plan.q, plan.q1, at["joint"].copy())

    def change(self, drive: ClosedLoop) -> None:
        """Another law, or another force to aim at."""
        before, self._drive = self._drive.path, drive
        path = drive.path
        if path is not before:
            force = np.interp(self._ticks, path.force_times, path.force).tolist()
            aims = zip(self.aims, force, strict=True)
            self.aims = [replace(aim, force=f) for aim, f in aims]
            if self._rows is not None:
                self._rows[:, -1] = force

    def side(self) -> Side:
        """What compiled code shares with this."""
        rows = [np.concatenate([*a.state, a.joint, a.joint_rate, [a.force]]) for a in self.aims]
        self._rows = np.array(rows)
        looks = self.command, self.count, self.estimate, self.force
        return Side(self._rows, *looks, self.memory, self.observer)

    def look(self, t: float, y: np.ndarray, modes: list[int], k: int) -> np.ndarray:
        """Look at tick k; returns the efforts asked for that begin to act now, (n,)."""
        plant, law = self._plant, self._drive.law
        plant.state(t, y, modes)
        at, m = plant.last, self._m
        joint, rate = at["joint"].copy(), at["joint_rate"].copy()
        q, q1 = y[:m].copy(), y[m : 2 * m].copy()
        force = plant.force_at(law.place, t, modes)
        if self.observer is not None:
            joint, rate, q, q1 = self.observer.see(joint, rate)
        now = Measured(t, q, q1, joint, rate, force)
        asked, after = law(now, self.aims[k], self.memory)
        self.memory[:] = after  # in place: compiled code goes on from here, too
        self.command[k], self.count[k] = asked, joint
        self.estimate[k], self.force[k] = np.concatenate([q, q1]), np.linalg.norm(force)
        # Until the first efforts come, the drives hold what they will be.
        return self.command[max(k - self._drive.delay, 0)]

    def at_once(self, t: float, y: np.ndarray, modes: list[int]) -> np.ndarray:
        """Efforts of an ideal controller at the state that was looked at last, (n,)."""
        at, law, m = self._plant.last, self._drive.law, self._m
        force = self._plant.force_at(law.place, t, modes)
        now = Measured(t, y[:m], y[m : 2 * m], at["joint"], at["joint_rate"], force)
        asked, _ = law(now, self._drive.path.at(t), self.memory)
        if not np.isfinite(asked).all():
            raise Stuck(Status.infeasible)
        return asked
