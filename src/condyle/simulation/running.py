"""Run a plan: from corner to corner, with a look at events after every step."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NoReturn

import numpy as np

from ..progress import step as progress
from ..status import STATUS_NAMES, Status
from .control import Controller, Lost
from .events import KINDS, Event
from .integrators import Stuck, integrator
from .plan import ClosedLoop, OpenLoop, Plan, Trace
from .plant import Plant
from .steps import BUDGET, DONE, LOOK, PAUSE, STEP, Steps, steps_of
from .watch import Crossing, Watch

ROUNDING = 1e-12  # seconds
CLOSE = 1e-6  # of a step: there already
MANY = 100  # events of a kind and an owner that are listed
SAY = 0.01  # seconds of the simulation between two words of progress


def run(plan: Plan, compiled: bool = True) -> Trace:
    """What happens; compiled: by compiled code where there is any."""
    with progress("simulating", plan.duration) as advance:
        return Run(plan, advance, compiled).trace()


class Run:
    """One run of a plan, under way.

    t, y: where it is [s], and the state there;  modes: of the loads;  events: up to there.
    kept: (N, size), states at the results' times;  kept_modes: (N, loads).
    """

    def __init__(
        self,
        plan: Plan,
        advance: Callable[[float], None] = lambda _: None,
        compiled: bool = True,
    ) -> None:
        self._plan, self._advance = plan, advance
        self.plant = Plant(plan)
        drive = plan.drive
        self.control = Controller(plan) if isinstance(drive, ClosedLoop) else None
        if self.control is not None:
            self.control.fill(plan)
            self.control.begin(plan)
        self._watch = Watch(plan, self.plant, self._look)
        self.events: list[Event] = []
        self._seen: dict[tuple[str, str], int] = {}
        count = len(plan.times)
        self.kept = np.empty((count, plan.size))
        self.kept_modes = np.zeros((count, len(plan.loads)), dtype=np.int8)
        self._cut = np.zeros(len(plan.low), dtype=bool)
        self._corners, self._ticks = plan.corners(), plan.ticks()
        self._integrator: Any = integrator(plan.method, self._rate, plan.settings)
        self._y = np.zeros((plan.size, 1))  # shared with compiled code
        self.y = np.concatenate([plan.q, plan.q1, np.zeros(plan.size - 2 * len(plan.q))])
        self.t, self.tick, self.next, self.corner, self.fresh = 0.0, -1, 0, 0, True
        self.modes = list(plan.modes)
        self.plant.set_modes(self.modes)
        # On the results' rows, of which `kept` is a view of one run.
        shared = self._watch.guards, self.plant.fed(plan), self._y
        past = self._watch.past[:, None], np.ones(1, dtype=np.uint8), self.kept
        self.steps: Steps | None = (
            steps_of(self.plant, self.control, *shared, *past) if compiled else None
        )

    def trace(self) -> Trace:
        """Run to the end, or to what ends it."""
        with suppress(Ended):
            self.go_to(self._plan.duration)
            self._keep_end(self._plan.duration, self.y)
        return self._trace()

    def take_over(
        self,
        steps: Steps,
        y: np.ndarray,
        kept: np.ndarray,
        crowd: Controller | None,
        plant: Plant,
        i: int,
    ) -> None:
        """Go on alone from where a crowd has brought its run i, without an event so far."""
        at, columns = steps.run, self.plant.columns
        self.t, self.tick, self.next = at.t, at.tick, at.next
        self.corner, self.fresh, self.y = at.corner, bool(at.fresh), y.copy()
        self.kept[: self.next] = kept[: self.next]
        self.kept_modes[: self.next] = self.modes
        columns.given[:, 0] = plant.columns.given[:, i]
        if crowd is None or self.control is None:
            return
        own, looked = self.control, self.tick + 1
        own.columns.given[:, 0] = crowd.columns.given[:, i]
        own.looks[:looked, :, 0] = crowd.looks[:looked, :, i]
        own.states[:looked, :, 0] = crowd.states[:looked, :, i]
        self._saturated(0)

    def go_to(self, until: float) -> None:
        """Run to a time, or to the next step after it [s].

        Raises: Ended: where the run is over before.
        """
        if self.steps is not None:
            self._by_compiled_code(until, self.steps)
        else:
            self._by_steps(until)

    def change(self, plan: Plan) -> None:
        """Go on with other numbers in the law and in the loads, which stay what they are."""
        force = self._force(plan)
        if self.control is not None and force is not self._force(self._plan):
            self.control.aim_for(np.interp(self._ticks, plan.drive.path.force_times, force))  # type: ignore[union-attr]
        self._plan = plan
        self.plant.fill(plan)
        self._watch.change(plan)
        if self.control is not None:
            self.control.fill(plan)
        for crossing in self._watch.overtaken(self.t, self.y, self.modes):
            self._happened(crossing)

    @staticmethod
    def _force(plan: Plan) -> Any:
        return plan.drive.path.force if isinstance(plan.drive, ClosedLoop) else None

    def look(self) -> np.ndarray:
        """Look at where it is; returns the efforts that act now, within limits, (n,).

        Raises: Stuck: where it cannot be.
        """
        return self._acting(self.t, self.y)

    def _acting(self, t: float, y: np.ndarray) -> np.ndarray:
        self._look(t, y)
        asked = self.plant.columns.given[self.plant.columns.rows("effort"), 0]
        return np.clip(asked, self._plan.low, self._plan.high)

    def _by_steps(self, until: float) -> None:
        """From corner to corner."""
        said = self.t
        while self.t < until - ROUNDING:
            due = self.tick + 1
            if due < len(self._ticks) and self._ticks[due] <= self.t + ROUNDING:
                self._tick_at(self.t, self.y, due)
            corner = float(self._corners[self.corner + 1])
            end = min(corner, until)
            _, self.y = self._between(self.t, end, self.y)
            self.t = end
            self.corner += end == corner
            if end - said >= SAY:
                self._advance(end - said)
                said = end

    def _by_compiled_code(self, until: float, steps: Steps) -> None:
        """The same by `steps.c`, but for what it hands back."""
        size, end, run = self._plan.settings.step, self._plan.duration, steps.run
        assert size is not None
        while True:
            self._y[:, 0] = self.y
            run.t, run.tick, run.next = self.t, self.tick, self.next
            run.corner, run.fresh, run.seen = self.corner, self.fresh, 0
            left = math.ceil((until - self.t) / size - CLOSE)
            code = steps.advance(min(max(left, 1), BUDGET))
            said, t, y = self.t, run.t, self._y[:, 0].copy()
            self.kept_modes[self.next : run.next] = self.modes
            first, self.tick, self.next = self.tick + 1, run.tick, run.next
            self.corner, self.fresh, self.t, self.y = run.corner, bool(run.fresh), t, y
            self._saturated(first)
            self._advance(t - said)
            if code == DONE or (code == PAUSE and t >= until - CLOSE * size and until < end):
                return
            if code == LOOK:
                self._tick_at(t, y, self.tick + 1)
                self.fresh = False
            elif code == STEP:
                corner = float(self._corners[self.corner + 1])
                t, y = self._between(t, corner, y, once=True)
                self.t, self.y = t, y
                self.fresh = False
                if t >= corner - ROUNDING:
                    self.corner += 1
                    self.fresh = True

    def _trace(self) -> Trace:
        plan, control, looked = self._plan, self.control, self.tick + 1
        t, state, m, n = plan.times[: self.next], self.kept[: self.next], len(plan.q), len(plan.low)
        modes, drive = self.kept_modes[: self.next], plan.drive
        if isinstance(drive, OpenLoop) or not len(self._ticks):
            tick = np.full(len(t), -1)
        else:
            tick = np.searchsorted(self._ticks, t + ROUNDING, side="right") - 1
            tick = np.minimum(tick, self.tick)
        if control is None or not len(self._ticks):
            effort = self._efforts(t, state, modes)
            seen: dict[str, np.ndarray] = dict.fromkeys(("command", "count"), np.empty((0, n)))
            seen |= {"estimate": np.empty((0, 2 * m)), "force": np.empty(0)}
        else:
            looks, rows = control.looks[:looked, :, 0], control.columns.result
            due = np.maximum(tick - drive.delay, 0)  # type: ignore[union-attr]
            effort = looks[due][:, rows("effort")] if looked else np.zeros((len(t), n))
            seen = {
                "command": looks[:, rows("asked")],
                "count": looks[:, rows("joint")],
                "estimate": looks[:, np.concatenate([rows("q"), rows("q1")])],
                "force": np.linalg.norm(looks[:, rows("felt")], axis=1),
            }
        return Trace(t, state, modes, effort, tick, **seen, events=tuple(self.events))

    def _efforts(self, t: np.ndarray, state: np.ndarray, modes: np.ndarray) -> np.ndarray:
        """As they acted at the results' times, where they follow from time and state, (N, n)."""
        plan, drive = self._plan, self._plan.drive
        if isinstance(drive, OpenLoop):
            fed = next(table for table in self.plant.fed(plan) if table.port == "effort")
            return np.clip(fed.at(t), plan.low, plan.high)
        found = np.empty((len(t), len(plan.low)))
        for i, when in enumerate(t.tolist()):
            self.plant.set_modes(modes[i].tolist())
            found[i] = self._acting(when, state[i])
        return found

    # -- efforts ------------------------------------------------------------------------------

    def _look(self, t: float, y: np.ndarray) -> None:
        """Look at a state with the efforts that act there."""
        self.plant.look(t, y)
        if self.control is not None and not len(self._ticks):
            asked = self.control.at_once(t, y, self.plant)
            if not np.isfinite(asked).all():
                raise Stuck(Status.infeasible)
            self.plant.columns.give("effort", asked)
            self.plant.look(t, y)

    def _rate(self, t: float, y: np.ndarray) -> np.ndarray:
        self._look(t, y)
        return self.plant["rate"]

    def _tick_at(self, t: float, y: np.ndarray, k: int) -> None:
        """The controller looks, and what it asked for before comes to act."""
        assert self.control is not None
        try:
            self.plant.look(t, y)
            asked = self.control.look(t, y, self.plant, k)
        except Lost:
            self._end(t, y, "lost", KINDS["lost"])
        except Stuck as stuck:
            self._stuck(t, y, stuck)
        if not np.isfinite(asked).all():
            self._end(t, y, "no_effort", KINDS["no_effort"])
        self.plant.columns.give("effort", self.control.acting(k))
        self.tick = k
        self._saturated(k)

    def _saturated(self, first: int) -> None:
        """Tell of efforts that limits cut, of the looks from the first on."""
        control, m = self.control, len(self._plan.q)
        if control is None or first > self.tick:
            return
        delay = self._plan.drive.delay  # type: ignore[union-attr]
        ticks = np.arange(first, self.tick + 1)
        due = control.looks[np.maximum(ticks - delay, 0), :, 0]
        asked, gives = (due[:, control.columns.result(name)] for name in ("asked", "effort"))
        cut = asked != gives
        new = cut & ~np.vstack([self._cut, cut[:-1]])
        for i, chain in np.argwhere(new):
            name = self._plan.model.mechanism.chain_names[chain]
            text = f"asked for {asked[i, chain]:.4g}, gives {gives[i, chain]:.4g}"
            k = first + i
            self._note(self._ticks[k], control.states[k, : 2 * m, 0], "saturated", text, name)
        self._cut = cut[-1]

    # -- between two corners ------------------------------------------------------------------

    def _between(
        self, t: float, until: float, y: np.ndarray, once: bool = False
    ) -> tuple[float, np.ndarray]:
        """Integrate to `until`, or one step; raises Ended where the run is over before."""
        try:
            self._begin(t, until, y)
            while t < until - ROUNDING:
                step = self._integrator.step()
                crossing = self._watch.crossing(step)
                end = step.t1 if crossing is None else crossing.time
                self._keep(t, end, step.at)
                t, y = end, step.y1
                if crossing is not None:
                    y = crossing.state
                    self._happened(crossing)
                    if t < until - ROUNDING and not once:
                        self._begin(t, until, y)
                if once:
                    break
        except Stuck as stuck:
            self._stuck(t, y, stuck)
        return t, y

    def _stuck(self, t: float, y: np.ndarray, stuck: Stuck) -> NoReturn:
        self._keep_end(t, y)
        kind = "stiff" if stuck.status is None else STATUS_NAMES[stuck.status]
        kind = kind if kind in KINDS else "stiff"
        self._end(t, y, kind, KINDS[kind])

    def _begin(self, t: float, until: float, y: np.ndarray) -> None:
        self._integrator.restart(t, y, until)
        for crossing in self._watch.begin(t, y):
            self._happened(crossing)

    def _happened(self, crossing: Crossing) -> None:
        t, y, guard = crossing.time, crossing.state, crossing.guard
        if guard.load is not None:
            self.modes[guard.load] = guard.mode
            self.plant.set_modes(self.modes)
        if guard.ends:
            self._keep_end(t, y)
            self._end(t, y, guard.kind, guard.text, guard.owner)
        elif guard.kind:
            self._note(t, y, guard.kind, guard.text, guard.owner)

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
        while self.next < len(times) and times[self.next] < end - ROUNDING:
            self._keep_one(at(max(times[self.next], t)))

    def _keep_end(self, t: float, y: np.ndarray) -> None:
        """The last one."""
        times = self._plan.times
        while self.next < len(times) and times[self.next] <= t + ROUNDING:
            self._keep_one(y)

    def _keep_one(self, y: np.ndarray) -> None:
        self.kept[self.next], self.kept_modes[self.next] = y, self.modes
        self.next += 1


class Ended(Exception):
    """The run is over; why is among the events."""
