"""The plan of a simulation: a scenario on a mechanism, in plain numbers, and its trace."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..mechanism.contact import Contact
from ..model.model import Model
from ..questions.law import Law
from ..questions.lifting import LiftingContact
from ..questions.load import ActingLoad
from ..questions.tick_limits import NONE as NO_LIMITS
from ..questions.tick_limits import TickLimits
from ..results.contact_lifts import ContactLift
from .drives import Drives
from .events import Event
from .integrators import FIXED, Settings
from .reference_path import ReferencePath
from .scenario import Scenario

# What lags in a state behind works: the port of `rate`, and the result that is its rate.
LAGS = {
    "activation": "activation_rate",
    "motor_joint": "motor_velocity",
    "motor_rate": "motor_acceleration",
}
WORKS = ("actuators", "load", "actuator_losses", "contact_friction")


@dataclass(frozen=True)
class OpenLoop:
    """Efforts over time: times (R,) [s], efforts (R, n), linear between rows, held outside.

    excited: whether those of muscles are excitations, and not the tensions wanted.
    """

    times: np.ndarray
    efforts: np.ndarray
    excited: bool = False


@dataclass(frozen=True)
class Sensing:
    """Encoders, and the observer of their counts.

    observer: how it comes to the state: see `condyle.questions.observer`.
    numbers:  of its ports, by name; resolution [rad or m] is one a chain (n,), 0 where exact.
    noise:    standard deviation of readings [rad or m];  seed: of these.
    """

    observer: str
    numbers: dict[str, np.ndarray]
    noise: float = 0.0
    seed: int = 1

    def errors(self, ticks: int) -> np.ndarray:
        """Errors of readings at every tick, (K, n) [rad or m]."""
        rng, n = np.random.default_rng(self.seed), len(self.numbers["resolution"])
        return self.noise * rng.normal(size=(ticks, n))


@dataclass(frozen=True)
class Misses:
    """How ticks are missed: late by up to `jitter` [s], a share `missed` left out."""

    jitter: float
    missed: float
    seed: int

    def of(self, ticks: np.ndarray) -> np.ndarray:
        """The ticks as they come, (K',) [s]; the first is in time."""
        rng = np.random.default_rng(self.seed)
        late = ticks + self.jitter * rng.random(len(ticks))
        come = rng.random(len(ticks)) >= self.missed
        late[0], come[0] = ticks[0], True
        return late[come]


@dataclass(frozen=True)
class ClosedLoop:
    """A law, called every period, whose efforts come `delay` periods later and are held.

    model:    of the mechanism, as the controller takes it to be.
    period:   [s]; None: at all times.
    sensing:  None: it measures the exact state.
    function: in Python, in the place of the law: (measured, reference) -> efforts (n,).
    misses:   None: every tick comes in time.
    limits:   parts of the tick's last stage;  numbers: of its ports, by name.
    """

    model: Model
    law: Law
    path: ReferencePath
    period: float | None
    delay: int = 0
    sensing: Sensing | None = None
    function: Callable[..., Any] | None = None
    misses: Misses | None = None
    limits: TickLimits = NO_LIMITS
    numbers: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class FreedContacts:
    """Faces of contacts of a run that lift and land, c of them: a contact with clearance has two.

    kept:        the same run with contacts that are kept: its controller's, and labels of results.
    coordinates: rows of its independent coordinates among those of the run, (m,).
    """

    kept: Plan
    coordinates: np.ndarray

    @property
    def compliant(self) -> bool:
        """Whether they give, by laws; else they are rigid."""
        return self.kept.scenario.contacts.kind == "compliant"

    @cached_property
    def _faces(self) -> list[tuple[int, int, Any]]:
        """The contact's number in the mechanism, the sign of its push, and its surface."""
        contacts = self.kept.model.mechanism.contacts
        return [(i, *face) for i, contact in enumerate(contacts) for face in contact.faces]

    @property
    def contacts(self) -> list[int]:
        """Contacts by number in the mechanism, (c,), in order."""
        return [i for i, _, _ in self._faces]

    @property
    def push(self) -> np.ndarray:
        """Signs of contact forces with which the faces push, (c,)."""
        return np.array([sign for _, sign, _ in self._faces], dtype=float)

    @property
    def tables(self) -> list[Contact]:
        """Each face's contact, (c,)."""
        contacts = self.kept.model.mechanism.contacts
        return [contacts[i] for i in self.contacts]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(contact.name for contact in self.tables)

    @property
    def forms(self) -> tuple[LiftingContact, ...]:
        """As questions take them."""
        return tuple(
            (surface.form, len(surface.constants()), one.friction.coefficient > 0)
            for (_, _, surface), one in zip(self._faces, self.tables, strict=True)
        )

    @property
    def restitution(self) -> np.ndarray:
        return np.array([one.restitution for one in self.tables])

    @property
    def friction(self) -> np.ndarray:
        """Coefficients, (c,)."""
        return np.array([one.friction.coefficient for one in self.tables])

    def ports(self) -> dict[str, Any]:
        """Their numbers, by port of the questions."""
        found: dict[str, Any] = {}
        for i, ((_, sign, surface), one) in enumerate(zip(self._faces, self.tables, strict=True)):
            own = {
                "point": one.point,
                "surface": surface.constants(),
                "push": [sign],
                "radius": [one.ball_radius or 0.0],
            }
            if one.friction.coefficient:
                own["friction"] = [one.friction.coefficient, one.friction.smoothing_speed**2]
            found |= {f"contact_{i}_{name}": np.array(x, float) for name, x in own.items()}
        return found

    def seen(self, state: np.ndarray) -> np.ndarray:
        """A state of the run, (..., size), as one of the run with contacts that are kept."""
        return state[..., self.seen_rows]

    @cached_property
    def seen_rows(self) -> np.ndarray:
        """Rows of the run's state that are the state of the run with contacts that are kept."""
        rows, m = self.coordinates, len(self.kept.q) + len({*self.contacts})
        rest = 2 * m + np.arange(self.kept.size - 2 * len(rows))
        return np.concatenate([rows, m + rows, rest])


@dataclass(frozen=True)
class Plan:
    """What to run.

    q, q1:    state to begin with, (m,) each;  modes: of the loads.
    times:    (N,) [s], of the results;  duration: [s].
    low, high, speed: limits of the actuators, (n,) each, infinite where there is none.
    method, settings: of the integrator.
    stop_at_bounds: whether a contact at the end of its surface ends the run.
    scenario, source: that it is of, and what messages call it.
    activation: of muscles to begin with, (n,), 0 for other chains; (0,) where there are none.
    drives: between the efforts that are asked for and the joints; None: rigid, and as asked for.
    sticking: contacts with static friction, by number.
    lifting: contacts that lift and land in this run;  freed: the plan to run in the place of this
             one, in which contacts do; None: they are kept.
    functions: in Python, by the number of the load whose wrench they give: (t, s, v) -> force (3,)
               or force and moment (6,).
    """

    model: Model
    q: np.ndarray
    q1: np.ndarray
    duration: float
    times: np.ndarray
    drive: OpenLoop | ClosedLoop
    loads: tuple[ActingLoad, ...]
    modes: tuple[int, ...]
    low: np.ndarray
    high: np.ndarray
    speed: np.ndarray
    method: str
    settings: Settings
    stop_at_bounds: bool = False
    scenario: Scenario = field(default_factory=Scenario)
    source: str = "scenario"
    activation: np.ndarray = field(default_factory=lambda: np.zeros(0))
    functions: dict[int, Callable[..., Any]] = field(default_factory=dict)
    drives: Drives | None = None
    sticking: tuple[int, ...] = ()
    lifting: FreedContacts | None = None
    freed: Plan | None = None

    @property
    def path(self) -> ReferencePath | None:
        """What the controller follows, if there is one."""
        return self.drive.path if isinstance(self.drive, ClosedLoop) else None

    @property
    def gripping(self) -> tuple[int, ...]:
        """Chains whose rotors have static friction, by number."""
        return () if self.drives is None else self.drives.gripping

    @property
    def flanks(self) -> np.ndarray:
        """Chains whose gears have play of which flanks are events, (n,): not in fixed steps."""
        if self.drives is None or self.method in FIXED:
            return np.zeros(len(self.low), dtype=bool)
        return self.drives.half_play > 0

    @property
    def given(self) -> tuple[str, ...]:
        """Whether gravity and the base's motion are given over time, by name."""
        return () if self.path is None else tuple(self.path.around)

    @property
    def size(self) -> int:
        """The size of the state: q, q', the works of `WORKS`, and what lags, lane by lane."""
        return 2 * len(self.q) + len(WORKS) + sum(x.size for x in self.lags.values())

    @property
    def lags(self) -> dict[str, np.ndarray]:
        """Values that lag, to begin with, (n,) each, by port of `LAGS`."""
        lags = {"activation": self.activation} if self.activation.size else {}
        if self.drives is not None:
            lags |= dict(zip(("motor_joint", "motor_rate"), self.drives.motor, strict=True))
        return lags

    def breakpoints(self) -> tuple[np.ndarray, np.ndarray]:
        """Times where the rate of the state may jump or kink, from 0 to the end [s], and which of
        them are ticks of the controller."""
        ticks = self.ticks()
        times = [np.array([0.0, self.duration]), ticks]
        if isinstance(self.drive, OpenLoop):
            times.append(self.drive.times)
        times += [load.times for load in self.loads]
        if self.path is not None and self.given:
            times.append(self.path.times[[0, -1]])
        every = np.unique(np.concatenate(times))
        every = every[(every >= 0) & (every <= self.duration)]
        apart = np.concatenate([np.diff(every) > 1e-12, [True]])
        distinct = every[apart]
        distinct[0] = 0.0
        is_tick = np.zeros(len(distinct), dtype=np.uint8)
        is_tick[np.clip(np.searchsorted(distinct, ticks - 1e-12), 0, len(distinct) - 1)] = 1
        is_tick[-1] = 0
        return distinct, is_tick

    def ticks(self) -> np.ndarray:
        """Times at which the controller samples, (K,) [s]; none in open loop."""
        if isinstance(self.drive, OpenLoop) or self.drive.period is None:
            return np.empty(0)
        rate = 1.0 / self.drive.period
        count = max(int(np.ceil(self.duration * rate - 1e-9)), 1)
        ticks = np.arange(count) / rate
        return ticks if self.drive.misses is None else self.drive.misses.of(ticks)


@dataclass(frozen=True)
class Trace:
    """What happened, at the times that were reached.

    t: (N,) [s];  state: (N, size), as of `Plan.size`;  modes: (N, loads).
    effort: (N, n), as it acted, of muscles as it was commanded.
    tick: (N,), index of the controller's last sample, -1 without one.
    command, count: (K, n), efforts asked for at every tick, and encoders' joints;
    estimate: (K, 2 m), the state that the controller took it to be;  force: (K,), of the bite.
    filtered: what an observer says besides, by name, (K, numbers) each.
    events: in order; the last one may have ended the run.
    lifts: of contacts that were open, by name.
    """

    t: np.ndarray
    state: np.ndarray
    modes: np.ndarray
    effort: np.ndarray
    tick: np.ndarray
    command: np.ndarray
    count: np.ndarray
    estimate: np.ndarray
    force: np.ndarray
    filtered: dict[str, np.ndarray]
    events: tuple[Event, ...]
    lifts: dict[str, ContactLift]

    @property
    def ended(self) -> Event | None:
        """What ended the run before its time."""
        return self.events[-1] if self.events and self.events[-1].ends else None
