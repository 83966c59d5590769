"""Runs of plans: from breakpoint to breakpoint, with a check for events after every step.

A run is a crowd of one. Runs that are alike but for their numbers go on in lockstep by compiled
code, step by step through the batches of two kernels; one that has an event, or a state that a
kernel cannot vouch for, leaves the crowd before that step and goes on alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np

from ..backends.threads import workers
from ..model.model import Model
from ..progress import step as progress
from ..questions.tick_limits import MISSING
from ..status import STATUS_NAMES, Status
from .control import Controller, PoseLostError
from .events import KINDS, Event, EventLog
from .gripping import GrippingDrives
from .integrators import FIXED, NoRateError, integrator
from .lifting import CompliantLifting, LiftingContacts, RigidLifting
from .plan import ClosedLoop, OpenLoop, Plan, Trace
from .plant import Guard, Plant, fed
from .steps import BUDGET, DONE, PAUSE, SAMPLE, STEP, Clock, Stepper, steps_of
from .sticking import StaticFriction, StickingContacts
from .watch import Crossing, RunGuards

ROUNDING = 1e-12  # seconds
CLOSE = 1e-6  # of a step: there already
REPORTED = 0.01  # seconds of the simulation between two reports of progress
FILTERED = ("measured_force", "covariance", "innovation")  # results of a tick with a filter
TOGETHER = 128  # runs of a crowd: what they work on stays in a cache


def run(plan: Plan, compiled: bool = True) -> Trace:
    """What happens; compiled: by compiled code where there is any."""
    plan = plan.freed or plan
    with progress("simulating", plan.duration) as report:
        return Batch([plan], report, compiled).traces()[0]


def run_all(plans: Sequence[Plan], threads: int | None = None) -> list[Trace]:
    """What happens in each, those alike in lockstep; results do not depend on the threads."""
    if len(plans) == 1:
        return [run(plans[0])]
    plans = [plan.freed or plan for plan in plans]
    alike: dict[Any, list[int]] = {}
    for i, plan in enumerate(plans):
        lockstep = plan.method in FIXED and plan.lifting is None and not plan.sticking
        lockstep = lockstep and not plan.gripping
        alike.setdefault(_shape(plan) if lockstep else i, []).append(i)
    parts = [
        part[start : start + TOGETHER]
        for part in alike.values()
        for start in range(0, len(part), TOGETHER)
    ]
    traces: dict[int, Trace] = {}
    with progress("simulating", sum(plan.duration for plan in plans)) as report:

        def together(part: list[int]) -> None:
            crowd = Batch([plans[i] for i in part], lambda t: report(t * len(part)))
            traces.update(zip(part, crowd.traces(), strict=True))

        for part in alike.values():
            for some in (part[:1], part[:TOGETHER]):
                Batch([plans[i] for i in some])  # kernels are there before threads ask for them
        with ThreadPoolExecutor(workers(threads)) as pool:
            list(pool.map(together, parts))
    return [traces[i] for i in range(len(plans))]


def _shape(plan: Plan) -> Any:
    """What runs in lockstep have in common."""
    drive = plan.drive
    if isinstance(drive, OpenLoop):
        own: tuple[Any, ...] = (drive.times.tobytes(),)
    else:
        sensing = None if drive.sensing is None else drive.sensing.observer
        own = (_family(drive.model), drive.law.table, drive.law.choices, drive.period, drive.delay)
        own += (sensing, drive.law.place, drive.function, plan.given, drive.misses)
        own += (drive.path.times.tobytes(),) if plan.given else ()
    loads = tuple((load.law, load.place, load.times.tobytes()) for load in plan.loads)
    limits = np.isfinite(plan.speed).tobytes()
    time = (plan.duration, plan.times.tobytes(), plan.method, plan.settings.step)
    drives = plan.drives and (plan.drives.side, plan.drives.limited.tobytes())
    return _family(plan.model), own, loads, limits, time, tuple(plan.functions), drives


def _family(model: Model) -> Any:
    """What models have in common whose numbers alone differ."""
    return id(model.system.family), model.distribution, model.mechanism.contact_names


class Batch:
    """Plans under way, which are alike; of several, all that is not compiled code's is left alone.

    clock: time, tick and breakpoint, shared with compiled code;  y: (size, runs), the states;
    modes: (loads, runs);  logs: events of each run;  kept: (N, size, runs), states at the results'
    times;  kept_modes: (N, loads, runs).
    """

    def __init__(
        self,
        plans: Sequence[Plan],
        report: Callable[[float], None] = lambda _: None,
        compiled: bool = True,
    ) -> None:
        """Args: report: of progress, is given seconds of the simulation."""
        plan, runs = plans[0], len(plans)
        self.plans: list[Plan] = list(plans)
        self._report = report
        self.plant: Plant = Plant(plans)
        self.control: Controller | None = None
        if isinstance(plan.drive, ClosedLoop):
            seen = [p if p.lifting is None else p.lifting.kept for p in plans]
            self.control = Controller(seen)
            self.control.begin(seen)
        self._watch = RunGuards(plan, self.plant, self._evaluate, runs)
        self.logs: list[EventLog] = [EventLog(plan.model.independent) for _ in plans]
        self._integrator: Any = integrator(plan.method, self._rate, plan.settings)
        self._breakpoints, self._is_tick = plan.breakpoints()
        self._ticks = plan.ticks()
        self.y: np.ndarray = np.zeros((plan.size, self.plant.columns.stride))
        self.y[: 2 * len(plan.q), :runs] = np.transpose([[*p.q, *p.q1] for p in plans])
        for port, rows in self.plant.lags.items():
            self.y[rows, :runs] = np.transpose([p.lags[port] for p in plans])
        self.kept: np.ndarray = np.empty((len(plan.times), *self.y.shape))
        contacts = len(plan.sticking or plan.gripping)
        contacts = contacts if plan.lifting is None else len(plan.lifting.names)
        self.modes: np.ndarray = np.zeros((len(plan.modes) + contacts, runs), dtype=np.int8)
        self.modes[: len(plan.modes)] = np.transpose([p.modes for p in plans])
        self.kept_modes: np.ndarray = np.zeros((len(plan.times), *self.modes.shape), dtype=np.int8)
        self.plant.set_modes(self.modes)
        self._lifting: LiftingContacts | StaticFriction | None = None
        if plan.sticking or plan.gripping:
            held = StickingContacts if plan.sticking else GrippingDrives
            self._lifting = held(plan, self.plant, self._evaluate)
            with suppress(NoRateError):
                self._lifting.begin(self.state)
            self.modes[len(plan.modes) :, 0] = self._lifting.active
        elif contacts:
            kind = RigidLifting if self.plant.laws is None else CompliantLifting
            self._lifting = kind(plan, self.plant, self._evaluate)
        self._cut, self._noted = np.zeros((len(plan.low), runs), dtype=bool), -1
        self.alive: np.ndarray = np.ones(runs, dtype=np.uint8)
        self._left: dict[int, Trace] = {}
        self.clock: Clock = Clock()
        self._rigid = self._lifting if isinstance(self._lifting, RigidLifting) else None
        shared = self._rigid, self.clock, self._watch, self.y, self.alive, self.kept
        self.steps: Stepper | None = (
            steps_of(self.plant, self.control, *shared) if compiled else None
        )

    @property
    def state(self) -> np.ndarray:
        """The state of the first run, (size,)."""
        return self.y[:, 0]

    @property
    def events(self) -> list[Event]:
        """Events of the first run, up to now."""
        return self.logs[0].events

    def traces(self) -> list[Trace]:
        """Run to the end, or to what ends each."""
        with suppress(RunEndedError):
            self.go_to(self.plans[0].duration)
            self._keep_end(self.plans[0].duration, self.y)
        return [self._left.get(i) or self._trace(i) for i in range(len(self.plans))]

    def go_to(self, until: float) -> None:
        """Run to a time, or to the next step after it [s].

        Raises: RunEndedError: where the run is over before.
        """
        clock, plan, reported = self.clock, self.plans[0], self.clock.t
        while True:
            first = clock.next
            code = self._advance(until)
            self.kept_modes[first : clock.next] = self.modes
            self._note_saturation()
            self._note_chatter()
            if code in (DONE, PAUSE) or clock.t - reported >= REPORTED:
                self._report(clock.t - reported)
                reported = clock.t
            if code == DONE:
                return
            if code == PAUSE:
                assert plan.settings.step is not None
                if clock.t >= until - CLOSE * plan.settings.step and until < plan.duration:
                    return
            elif len(self.plans) > 1:
                self._part()
            elif code == SAMPLE:
                self._tick(clock.tick + 1)
                clock.fresh = 0
            else:
                self._stretch(until)

    def change(self, plan: Plan) -> None:
        """Go on with other numbers in the law and in the loads, which stay what they are."""
        force = self._force(plan)
        if self.control is not None and force is not self._force(self.plans[0]):
            self.control.set_force(np.interp(self._ticks, plan.drive.path.force_times, force))  # type: ignore[union-attr]
        self.plans = [plan]
        self.plant.fill(self.plans)
        self._watch.change(plan)
        if self.control is not None:
            self.control.fill(self.plans)
        for crossing in self._watch.overtaken(self.clock.t, self.state, self.modes[:, 0].tolist()):
            self._happened(crossing)

    @staticmethod
    def _force(plan: Plan) -> Any:
        return plan.drive.path.force if isinstance(plan.drive, ClosedLoop) else None

    def acting(self, t: float, y: np.ndarray) -> np.ndarray:
        """Evaluate a state; returns the efforts that act there, within limits, (n,).

        Raises: NoRateError: where it cannot be.
        """
        self._evaluate(t, y)
        asked = self.plant.columns.given[self.plant.columns.rows("effort"), 0]
        return np.clip(asked, self.plans[0].low, self.plans[0].high)

    # -- on the way -----------------------------------------------------------------------------

    def _advance(self, until: float) -> int:
        """Advance by compiled code to what it leaves to others; without it: a tick or stretch."""
        clock, begun = self.clock, self._rigid is None or self._rigid.begun
        if self.steps is not None and self.alive.any() and begun:
            clock.current, size = 0, self.plans[0].settings.step
            assert size is not None
            left = math.ceil((until - clock.t) / size - CLOSE)
            return self.steps.advance(min(max(left, 1), BUDGET))
        if clock.t >= until - ROUNDING or not self.alive.any():
            return DONE
        return SAMPLE if clock.fresh and self._is_tick[clock.breakpoint] else STEP

    def _stretch(self, until: float) -> None:
        """Integrate to the next breakpoint or to `until`; beside compiled code, for one step."""
        clock, once = self.clock, self.steps is not None
        end = float(self._breakpoints[clock.breakpoint + 1])
        stop = end if once else min(end, until)
        t, self.y[:, 0] = self._between(clock.t, stop, self.state.copy(), once)
        clock.fresh = int(t >= end - ROUNDING)
        clock.t = end if clock.fresh else t
        clock.breakpoint += clock.fresh

    def _part(self) -> None:
        """Let runs go on alone that compiled code leaves to others."""
        gone = self.alive.copy() if self.steps is None else self.steps.gone
        for i in np.flatnonzero(gone).tolist():
            own = Batch([self.plans[i]])
            own.take_over(self, i)
            self._left[i], self.alive[i] = own.traces()[0], False

    def take_over(self, crowd: Batch, i: int) -> None:
        """Go on from where a crowd has brought its run i, without a step of Python's so far."""
        for name in ("t", "tick", "next", "breakpoint", "fresh"):
            setattr(self.clock, name, getattr(crowd.clock, name))
        recorded, sampled = self.clock.next, self.clock.tick + 1
        self.logs, self._noted, self._cut = [crowd.logs[i]], crowd._noted, crowd._cut[:, [i]]
        pairs: list[tuple[np.ndarray, np.ndarray]] = [
            (self.y, crowd.y),
            (self._watch.past, crowd._watch.past),
            (self._watch.met, crowd._watch.met),
            (self.kept[:recorded], crowd.kept[:recorded]),
            (self.kept_modes[:recorded], crowd.kept_modes[:recorded]),
            (self.plant.columns.given, crowd.plant.columns.given),
        ]
        if (own := self.control) is not None and (theirs := crowd.control) is not None:
            pairs += [
                (own.columns.given, theirs.columns.given),
                (own.samples[:sampled], theirs.samples[:sampled]),
                (own.states[:sampled], theirs.states[:sampled]),
            ]
        for to, source in pairs:  # rows of the crowd's numbers come last
            to[..., 0] = source[: len(to), ..., i]

    def _trace(self, i: int) -> Trace:
        self._note_chatter()
        plan, control, sampled = self.plans[i], self.control, self.clock.tick + 1
        reached, m, n = self.clock.next, len(plan.q), len(plan.low)
        t, state = plan.times[:reached], self.kept[:reached, :, i].copy()
        modes, drive = self.kept_modes[:reached, :, i].copy(), plan.drive
        if isinstance(drive, OpenLoop) or control is None or not len(self._ticks):
            tick = np.full(len(t), -1)
            columns: dict[str, np.ndarray] = dict.fromkeys(("command", "count"), np.empty((0, n)))
            columns |= {"estimate": np.empty((0, 2 * m)), "force": np.empty(0)}
            filtered = {}
            effort = self._efforts(plan, t, state, modes)
        else:
            tick = np.searchsorted(self._ticks, t + ROUNDING, side="right") - 1
            tick = np.minimum(tick, self.clock.tick)
            samples, rows = control.samples[:sampled, :, i], control.columns.result
            due = np.maximum(tick - drive.delay, 0)
            effort = samples[:, rows("effort")][due] if sampled else np.zeros((len(t), n))
            columns = {
                "command": samples[:, rows("asked")],
                "count": samples[:, rows("joint")] + drive.model.mechanism.zeros,
                "estimate": samples[:, np.concatenate([rows("q"), rows("q1")])],
                "force": np.linalg.norm(samples[:, rows("measured_force")], axis=1),
            }
            names = FILTERED if control.filters else ()
            filtered = {name: samples[:, rows(name)] for name in names}
        events = tuple(self.logs[i].events)
        lifts = {} if self._lifting is None else self._lifting.lifts(float(self.clock.t))
        return Trace(
            t, state, modes, effort, tick, **columns, filtered=filtered, events=events, lifts=lifts
        )

    def _efforts(
        self, plan: Plan, t: np.ndarray, state: np.ndarray, modes: np.ndarray
    ) -> np.ndarray:
        """As they acted at the results' times, where they follow from time and state, (N, n)."""
        if isinstance(plan.drive, OpenLoop):
            (table,) = (table for table in fed([plan]) if table.port == "effort")
            return np.clip(table.at(t), plan.low, plan.high)
        effort = np.empty((len(t), len(plan.low)))
        for i, when in enumerate(t.tolist()):
            self.plant.set_modes(modes[i])
            effort[i] = self.acting(when, state[i])
        return effort

    # -- efforts --------------------------------------------------------------------------------

    def _evaluate(self, t: float, y: np.ndarray) -> None:
        """Evaluate a state with the efforts that act there."""
        self.plant.evaluate(t, y)
        if self.control is not None and not len(self._ticks):
            asked = self.control.at_once(t, self._seen(y), self.plant)
            if not np.isfinite(asked).all():
                raise NoRateError(Status.infeasible)
            self.plant.columns.give("effort", asked)
            self.plant.evaluate(t, y)

    def _seen(self, y: np.ndarray) -> np.ndarray:
        """A state in the controller's coordinates."""
        lifting = self.plans[0].lifting
        return y if lifting is None else lifting.seen(y)

    def _rate(self, t: float, y: np.ndarray) -> np.ndarray:
        self._evaluate(t, y)
        return self.plant.columns.found[: len(y), 0].copy()

    def _tick(self, k: int) -> None:
        """The controller samples, and what it asked for before comes to act."""
        assert self.control is not None
        t, y = self.clock.t, self.state
        try:
            self.plant.evaluate(t, y)
            effort = self.control.sample(t, self._seen(y), self.plant, k)
        except PoseLostError:
            self._end(t, y, "lost")
        except NoRateError as error:
            self._end_without_rate(t, y, error)
        if not np.isfinite(effort).all():
            self._end(t, y, "no_effort")
        self.plant.columns.give("effort", self.control.acting(k))
        self.clock.tick = k

    def _note_saturation(self) -> None:
        """Note efforts that limits began to cut since the last tick that was noted."""
        control, ticks = self.control, np.arange(self._noted + 1, self.clock.tick + 1)
        if control is None or not len(ticks):
            return
        due = np.maximum(ticks - control.drive.delay, 0)[:, None]
        wanted, gives = (
            control.samples[due, control.columns.result(name), : len(self.plans)]
            for name in ("asked", "effort")
        )
        cut = wanted != gives
        new = cut & ~np.concatenate([self._cut[None], cut[:-1]])
        for k, chain, i in np.argwhere(new & (self.alive != 0)):
            name = self.plans[i].model.mechanism.chain_names[chain]
            text = f"asked for {wanted[k, chain, i]:.4g}, gives {gives[k, chain, i]:.4g}"
            at = ticks[k]
            self.logs[i].note(self._ticks[at], control.states[at, :, i], "saturated", text, name)
        if (row := control.columns.result("missing")).size:
            missing = control.samples[ticks, row[0], : len(self.plans)]
            before = control.samples[np.maximum(ticks - 1, 0), row[0], : len(self.plans)]
            begins = (missing > MISSING) & ((before <= MISSING) | (ticks == 0)[:, None])
            for k, i in np.argwhere(begins & (self.alive != 0)):
                text = f"{KINDS['overtaxed']}: {missing[k, i]:.1%} of a force is missing"
                at = ticks[k]
                self.logs[i].note(self._ticks[at], control.states[at, :, i], "overtaxed", text)
        self._cut, self._noted = cut[-1], self.clock.tick

    def _note_chatter(self) -> None:
        """Note limits that were met again since that was last noted."""
        watch = self._watch
        for g, i in np.argwhere(watch.again):
            guard, count = watch.guards[g], int(watch.again[g, i])
            if not self.logs[i].has(guard.kind, guard.owner):  # passed at once with another
                met = float(watch.met[g, i])
                self.logs[i].note(met, self.y[:, i], guard.kind, guard.text, guard.owner)
                count -= 1
            self.logs[i].repeat(guard.kind, guard.owner, count, watch.met[g, i])
        watch.again[:] = 0

    # -- between two breakpoints ----------------------------------------------------------------

    def _between(
        self, t: float, until: float, y: np.ndarray, once: bool
    ) -> tuple[float, np.ndarray]:
        """Integrate to `until`, or one step; raises RunEndedError where the run is over before."""
        try:
            y = self._begin(t, until, y)
            while t < until - ROUNDING:
                step = self._integrator.step()
                if self._lifting is not None:
                    step = replace(step, y1=self._lifting.projected(step.t1, step.y1))
                    self._integrator.correct(step.y1)
                crossing = self._watch.crossing(step)
                if self._lifting is not None:
                    crossing = self._lifting.landing(step, crossing)
                end = step.t1 if crossing is None else crossing.time
                self._keep(t, end, step.at)
                t, y = end, step.y1
                if crossing is not None:
                    y = self._happened(crossing)
                    if t < until - ROUNDING and not once:
                        y = self._begin(t, until, y)
                if once:
                    break
        except NoRateError as error:
            self._end_without_rate(t, y, error)
        return t, y

    def _begin(self, t: float, until: float, y: np.ndarray) -> np.ndarray:
        if self.plans[0].flanks.any():
            self._evaluate(t, y)
            self.plant.set_flanks(self.plant["drive_apart"])
        if self._lifting is not None and self._lifting.changes_at_once(t, y):
            y = self._contacts_changed(t, y)
        self._integrator.restart(t, y, until)
        for crossing in self._watch.begin(t, y):
            self._happened(crossing)
        return y

    def _contacts_changed(self, t: float, y: np.ndarray, guard: Guard | None = None) -> np.ndarray:
        """The state after contacts lift or land, the first of them that of a guard."""
        assert self._lifting is not None
        y, changes = self._lifting.settled(t, y, guard)
        self.modes[len(self.plans[0].modes) :, 0] = self._lifting.active
        for change in changes:
            self.logs[0].note(t, y, change.kind, change.text, change.owner)
        self._lifting.note(t, changes)
        return y

    def _happened(self, crossing: Crossing) -> np.ndarray:
        """Note an event; returns the state after it."""
        self._note_chatter()  # which was before
        t, y, guard = crossing.time, crossing.state, crossing.guard
        if guard.flank:
            return y
        text, force = guard.text, None
        if guard.contact is not None:
            return self._contacts_changed(t, y, guard)
        if guard.load is not None:
            self.plant.set_modes(self.modes)
            self._evaluate(t, y)
            force = float(np.linalg.norm(self.plant["load_force"].reshape(-1, 3)[guard.load]))
            text = text.replace("{force}", f"{force:.4g} N")
            self.modes[guard.load] = guard.mode
            self.plant.set_modes(self.modes)
        if guard.ends:
            self._keep_end(t, y)
            self._end(t, y, guard.kind, text, guard.owner)
        self.logs[0].note(t, y, guard.kind, text, guard.owner, force=force)
        return y

    def _end_without_rate(self, t: float, y: np.ndarray, error: NoRateError) -> NoReturn:
        self._keep_end(t, y)
        kind = "stiff" if error.status is None else STATUS_NAMES[error.status]
        self._end(t, y, kind if kind in KINDS else "stiff")

    def _end(
        self, t: float, y: np.ndarray, kind: str, text: str | None = None, owner: str = ""
    ) -> NoReturn:
        self.logs[0].note(t, y, kind, text or KINDS[kind], owner, ends=True)
        self.clock.t, self.y[:, 0] = t, y
        raise RunEndedError

    # -- what is kept -----------------------------------------------------------------------------

    def _keep(self, t: float, end: float, at: Callable[[float], np.ndarray]) -> None:
        """States at the results' times from t on, before the end."""
        times = self.plans[0].times
        while self.clock.next < len(times) and times[self.clock.next] < end - ROUNDING:
            now = max(float(times[self.clock.next]), t)
            state = at(now)
            self._record(state if self._lifting is None else self._lifting.projected(now, state))

    def _keep_end(self, t: float, y: np.ndarray) -> None:
        """The last one."""
        times = self.plans[0].times
        while self.clock.next < len(times) and times[self.clock.next] <= t + ROUNDING:
            self._record(y)

    def _record(self, y: np.ndarray) -> None:
        now = int(self.clock.next)
        self.kept[now], self.kept_modes[now] = y.reshape(len(y), -1), self.modes
        self.clock.next = now + 1


class RunEndedError(Exception):
    """The run is over; its events say why."""
