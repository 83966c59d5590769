"""Contacts that lift and land during a run: release, landing, and rest.

Such a run has the state of the mechanism without these contacts; which of them are active is a mode
each. Compliant ones are active where they are indented. Rigid ones that are active keep gap = 0 and
gap' = 0: accelerations do so by the question `rate`, and after every step positions and rates are
projected.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass

import numpy as np

from ..mechanism.home import characteristic_length
from ..questions.lifting import OPEN, QUIET
from ..results.contact_lifts import ContactLift
from ..status import Status
from .columns import KernelColumns
from .impact import NoImpactError, complementary, impulses
from .integrators import IntegrationStep, NoRateError
from .plan import WORKS, FreedContacts, Plan
from .plant import Guard, Plant
from .watch import TOLERANCE, Crossing

TOUCHING = 1e-9  # of the mechanism's size: gaps of contacts that take part in a landing
STILL = 1e-9  # of the mechanism's size a second: rates along the normal of none
REST = 1e-9  # of the mechanism's size: a rebound that would rise less is the last
PROJECTED = 1e-14  # of the mechanism's size, and a second
PROJECTIONS = 10
LANDING = 2.0  # times the way at a step's greater speed: no larger gap closes in it
LOOKS = 8  # within a step, for a contact that could land in it
AT_ONCE = 50  # landings with hardly any time between them, after which a run ends
FRICTION_WORK = WORKS.index("contact_friction")

Evaluate = Callable[[float, np.ndarray], None]


@dataclass(frozen=True)
class Change:
    """What happened at a contact: `contact_lifted` or `contact_landed`, in words.

    landing_speed: along the normal [m/s]; None of one that lifts.
    """

    kind: str
    text: str
    owner: str
    landing_speed: float | None = None


class LiftLog:
    """How the contacts of a run are open, up to now."""

    def __init__(self, names: Iterable[str]) -> None:
        self._lifts = {name: ContactLift() for name in names}
        self._open_since = dict.fromkeys(self._lifts, 0.0)

    def note(self, t: float, bearing: Collection[str], changes: Iterable[Change]) -> None:
        """Add what happened at t.

        Args: bearing: names of contacts that are active from here on.
        """
        landed = [one for one in changes if one.landing_speed is not None]
        for one in landed:
            self._lifts[one.owner].land(one.landing_speed or 0.0)
        for name in {one.owner for one in landed} | {*bearing}:
            self._end(name, t)
        for name in self._lifts.keys() - set(bearing):
            self._open_since.setdefault(name, t)

    def _end(self, name: str, t: float) -> None:
        if (since := self._open_since.pop(name, t)) < t:
            self._lifts[name].add(since, t)

    def lifts(self, t: float) -> dict[str, ContactLift]:
        """Lifts of contacts that were open, by name, at the end of the run."""
        for name in [*self._open_since]:
            self._end(name, t)
        return {name: lift for name, lift in self._lifts.items() if lift.count}


class LiftingContacts:
    """The contacts of one run.

    active: (c,), which bear.
    """

    def __init__(self, plan: Plan, plant: Plant, evaluate: Evaluate) -> None:
        """Args: evaluate: a state, with the efforts that act there."""
        assert plan.lifting is not None
        self._own: FreedContacts = plan.lifting
        self._plant, self._evaluate, self._m = plant, evaluate, len(plan.q)
        self._length = characteristic_length(plan.model.mechanism)
        self.active: np.ndarray = np.zeros(len(self._own.names), dtype=bool)
        self._landings = [  # they stand for no row
            Guard(-1, "contact_landed", "lands", name, contact=i)
            for i, name in enumerate(self._own.names)
        ]
        self._log = LiftLog(self._own.names)

    def note(self, t: float, changes: Iterable[Change]) -> None:
        """Add what happened at t, with the contacts of which a face is active from here on."""
        active = {name for name, on in zip(self._own.names, self.active, strict=True) if on}
        self._log.note(t, active, changes)

    def lifts(self, t: float) -> dict[str, ContactLift]:
        """Lifts of contacts, by name, at the end of the run."""
        return self._log.lifts(t)

    @abstractmethod
    def projected(self, t: float, y: np.ndarray) -> np.ndarray:
        """The state with active contacts as they have to be, (size,)."""

    @abstractmethod
    def changes_at_once(self, t: float, y: np.ndarray) -> bool:
        """Whether other contacts are active from here on, for efforts that jumped, or at first."""

    @abstractmethod
    def settled(
        self, t: float, y: np.ndarray, guard: Guard | None = None
    ) -> tuple[np.ndarray, list[Change]]:
        """The state from here on, and what happened to contacts, first to the guard's.

        Raises: NoRateError: where friction leaves no motion, or several, or landings do not end.
        """

    # -- between events -------------------------------------------------------------------------

    def landing(self, step: IntegrationStep, first: Crossing | None) -> Crossing | None:
        """The first landing within a step, or what happens before it."""
        end = step.t1 if first is None else first.time
        landed = [
            (t, i)
            for i in np.flatnonzero(~self.active).tolist()
            if (t := self._when(step, i, end)) is not None
        ]
        if not landed:
            return first
        t, i = min(landed)
        return Crossing(t, step.y1 if t == step.t1 else step.at(t), self._landings[i])

    def _gap(self, step: IntegrationStep, t: float, i: int) -> tuple[float, float]:
        self._evaluate(t, step.y0 if t == step.t0 else step.y1 if t == step.t1 else step.at(t))
        return float(self._plant["gap"][i]), float(self._plant["gap_rate"][i])

    def _when(self, step: IntegrationStep, i: int, end: float) -> float | None:
        """When an open contact's gap passes zero, if it does before the end.

        It may rise from zero at the start of the step, and fall within it: so it is looked for
        after the highest point that its first acceleration leads to.
        """
        from scipy.optimize import brentq

        span = end - step.t0
        gap, rate = self._gap(step, step.t0, i)
        last, last_rate = self._gap(step, end, i)
        if min(gap, last) > LANDING * span * max(abs(rate), abs(last_rate)) > 0:
            return None
        looks = [step.t0 + span * k / LOOKS for k in range(1, LOOKS)] + [end]
        falling = self._falling(step, i)
        if rate > 0 > falling and -rate / falling < span:
            looks = sorted([step.t0 - rate / falling, *looks])

        def gap_at(t: float) -> float:
            return self._gap(step, t, i)[0]

        before = step.t0
        for t in looks:
            if gap_at(t) < 0:
                if gap_at(before) <= 0:
                    return before + TOLERANCE
                return float(brentq(gap_at, before, t, xtol=TOLERANCE, rtol=1e-15))
            before = t
        return None

    def _falling(self, step: IntegrationStep, i: int) -> float:
        """gap'' of an open contact at the start of a step."""
        self._evaluate(step.t0, step.y0)
        plant = self._plant
        return float(plant["gap_bias"][i] + (self._matrix("gap_response") @ plant["pressing"])[i])

    def _set(self, active: np.ndarray) -> None:
        self.active[:] = active
        self._plant.columns.fill("active", [active.astype(float)])

    def _matrix(self, name: str) -> np.ndarray:
        c = len(self._own.names)
        return self._plant[name].reshape(-1, c)


class RigidLifting(LiftingContacts):
    """Contacts that do not give: they land by impulses, and keep their gaps closed.

    begun: whether it is known which are active.
    closed: greatest gap [m], and its rate [m/s], of an active one.
    touching, still: of an open one that touches [m] and does not leave [m/s].
    """

    def __init__(self, plan: Plan, plant: Plant, evaluate: Evaluate) -> None:
        super().__init__(plan, plant, evaluate)
        self.begun = False
        self.closed: float = PROJECTED * self._length
        self.touching: float = TOUCHING * self._length * 1e-3
        self.still: float = STILL * self._length
        self._impact = KernelColumns.of([plan.model], "impact", self._own.forms)
        for name, value in self._own.ports().items():
            self._impact.fill(name, [value])
        self._last, self._repeats = -1.0, 0

    def projected(self, t: float, y: np.ndarray) -> np.ndarray:
        """The state with active contacts closed, (size,)."""
        if not self.active.any():
            return y
        m, y, on = self._m, y.copy(), self.active
        for _ in range(PROJECTIONS):
            self._evaluate(t, y)
            off = self._plant["gap"][on], self._plant["gap_rate"][on]
            if max(np.abs(one).max() for one in off) <= self.closed:
                break
            R = self._matrix("gap_response")[np.ix_(on, on)]
            along = self._matrix("q_response")[:, on]
            try:
                for part, rows in zip(off, (slice(m), slice(m, 2 * m)), strict=True):
                    y[rows] -= along @ np.linalg.solve(R, part)
            except np.linalg.LinAlgError:
                break
        return y

    def changes_at_once(self, t: float, y: np.ndarray) -> bool:
        """Whether efforts that jumped release a contact, or press one that only touches; at first,
        whatever touches is to be judged."""
        self._evaluate(t, y)
        plant = self._plant
        if not self.begun:
            self.begun = True
            self.active[:] = self._near(plant["gap"], plant["gap_rate"])
            return bool(self.active.any())
        if self._leaving().any():
            return True
        touching = ~self.active & self._near(plant["gap"], plant["gap_rate"])
        if not touching.any():
            return False
        opening = plant["gap_bias"] + self._matrix("gap_response") @ plant["pressing"]
        return bool((opening[touching] < -QUIET).any())

    def _leaving(self) -> np.ndarray:
        """Active contacts that pull, where the plant was evaluated."""
        leaving: np.ndarray = self._plant["guards"][-len(self.active) :] > 0
        return leaving

    def _near(self, gap: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Contacts that touch, and do not leave."""
        near: np.ndarray = (gap <= self.touching) & (np.abs(rate) <= self.still)
        return near

    def settled(
        self, t: float, y: np.ndarray, guard: Guard | None = None
    ) -> tuple[np.ndarray, list[Change]]:
        """As of `LiftingContacts`: impacts, then which contacts stay active."""
        before, changes = self.active.copy(), list[Change]()
        landed = None if guard is None or guard.kind != "contact_landed" else guard.contact
        if landed is not None:
            self._count(t)
            y, changes = self._after_impact(t, y, landed)
        touching = self._candidates(t, y, landed)
        self._set(np.zeros_like(before))
        if touching.size:
            self._evaluate(t, y)
            R = self._matrix("gap_response")[np.ix_(touching, touching)]
            solutions = complementary(R, self._plant["gap_bias"][touching])
            if len(solutions) != 1:
                raise NoRateError(Status.ambiguous if solutions else Status.jammed)
            active = np.zeros_like(before)
            active[touching[solutions[0].active]] = True
            # One that leaves by no more than rounding stays, or it would land again at once.
            numbers, quiet = np.arange(len(before)), touching[solutions[0].a <= QUIET]
            stays = np.isin(numbers, quiet) & (before | (numbers == landed))
            if guard is not None and landed is None:
                stays[guard.contact] = False
            self._set(active | stays)
            self._evaluate(t, y)
            self._set(active | (stays & ~self._leaving()))
        y = self.projected(t, y)
        names = self._own.names
        for i in np.flatnonzero(before & ~self.active).tolist():
            changes.append(Change("contact_lifted", "lifts", names[i]))
        return y, changes

    def _count(self, t: float) -> None:
        self._repeats = self._repeats + 1 if t - self._last <= 100 * TOLERANCE else 0
        self._last = t
        if self._repeats > AT_ONCE:
            raise NoRateError

    def _candidates(self, t: float, y: np.ndarray, landed: int | None) -> np.ndarray:
        """Contacts that touch and neither leave nor approach, by number."""
        self._evaluate(t, y)
        gap, rate = self._plant["gap"], self._plant["gap_rate"]
        touches = self.active | (gap <= TOUCHING * self._length)
        return np.flatnonzero(touches & (np.abs(rate) <= self.still))

    def _after_impact(
        self, t: float, y: np.ndarray, landed: int
    ) -> tuple[np.ndarray, list[Change]]:
        self._evaluate(t, y)
        columns, m, own = self._impact, self._m, self._own
        columns.given[: 2 * m, 0] = y[: 2 * m]
        if columns.run():
            raise NoRateError
        count, velocity = len(own.names), columns["velocity"].reshape(-1, 3)
        touches = self.active | (columns["gap"] <= TOUCHING * self._length)
        touches[landed] = True
        T = np.flatnonzero(touches)
        every = columns["impulse_response"].reshape(count, 3, count, 3)
        G = every[T][:, :, T]
        e, mu = own.restitution[T], own.friction[T]
        try:
            P = impulses(G, velocity[T], e, mu)
        except NoImpactError:
            raise NoRateError from None
        after = velocity[T] + np.einsum("iajb,jb->ia", G, P)
        rests = self._rests(after[:, 0], T)
        if rests.any():
            S = np.flatnonzero(rests | (P[:, 0] > 0))
            left = np.where(rests, after[:, 0], 0.0)  # the others leave as they do
            P[S, 0] -= np.linalg.lstsq(G[:, 0, :, 0][np.ix_(S, S)], left[S])[0]
            after = velocity[T] + np.einsum("iajb,jb->ia", G, P)
            after[rests, 0] = 0.0
        y = y.copy()
        response = columns["q_response"].reshape(m, count, 3)[:, T]
        y[m : 2 * m] += np.einsum("mia,ia->m", response, P)
        y[2 * m + FRICTION_WORK] -= float((P * (velocity[T] + after)).sum()) / 2
        changes = []
        for i, contact in enumerate(T.tolist()):
            if contact == landed or (P[i, 0] > 0 and velocity[contact, 0] < 0):
                stays = abs(after[i, 0]) <= self.still
                then = "stays" if stays else f"leaves at {after[i, 0]:.4g} m/s"
                speed = max(float(-velocity[contact, 0]), 0.0)
                text = f"lands at {speed:.4g} m/s with {P[i, 0]:.4g} N s and {then}"
                changes.append(Change("contact_landed", text, own.names[contact], speed))
        return y, changes

    def _rests(self, leaving: np.ndarray, some: np.ndarray) -> np.ndarray:
        """Which of some contacts leave so slowly that they would rise less than `REST`, as a
        platform that no unilateral contact holds would fall back: bounces end there."""
        fall = -self._plant["gap_bias"][some]
        with np.errstate(divide="ignore", invalid="ignore"):
            rise = leaving**2 / (2 * fall)
        rests: np.ndarray = (leaving > 0) & (fall > 0) & (rise < REST * self._length)
        return rests


class CompliantLifting(LiftingContacts):
    """Contacts that give: forces follow from the state, so that modes are for events alone."""

    def projected(self, t: float, y: np.ndarray) -> np.ndarray:
        return y

    def changes_at_once(self, t: float, y: np.ndarray) -> bool:
        self._evaluate(t, y)
        return bool((self.active != self._indented()).any())

    def _indented(self) -> np.ndarray:
        gap, rate = self._plant["gap"], self._plant["gap_rate"]
        # One that has just landed may be above zero by more than rounding, and falls.
        touching = (self.active & ((gap <= OPEN) | (rate <= 0))) | ((gap == 0) & (rate <= 0))
        indented: np.ndarray = (gap < 0) | touching
        return indented

    def settled(
        self, t: float, y: np.ndarray, guard: Guard | None = None
    ) -> tuple[np.ndarray, list[Change]]:
        self._evaluate(t, y)
        now = self._indented()
        if guard is not None and guard.contact is not None:
            now[guard.contact] = guard.kind == "contact_landed"
        changes = list[Change]()
        for i in np.flatnonzero(now != self.active).tolist() if t > 0 else ():
            speed = float(abs(self._plant["gap_rate"][i]))
            kind, text = ("contact_landed", "lands") if now[i] else ("contact_lifted", "lifts")
            text, landing = f"{text} at {speed:.4g} m/s", speed if now[i] else None
            changes.append(Change(kind, text, self._own.names[i], landing))
        self._set(now)
        return y, changes
