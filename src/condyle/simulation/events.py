"""Events: what happened in a simulation, when, in which state; some end it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

# What each kind means; in the order in which a page lists them.
KINDS = {
    "bound": "a contact reaches the end of its surface",
    "contact_loss": "a unilateral contact would have to pull; for one that lifts and lands set "
    '[contacts] kind = "rigid"',
    "contact_lifted": "a contact lifts",
    "contact_landed": "a contact lands",
    "contact_slips": "a contact slips: static friction does not hold it",
    "contact_sticks": "a contact comes to rest, and sticks",
    "drive_slips": "a drive breaks away: static friction does not hold its rotor",
    "drive_sticks": "the rotor of a drive comes to rest, and sticks",
    "unreachable": "a chain or a contact cannot be closed any more",
    "uncertified": "the contacts' pose is beyond what a simulation can certify",
    "singular": "the mechanism is singular, and accelerations have no bound",
    "gimbal_lock": "beta is +-90 degrees: accelerations of the angles are not determined",
    "jammed": "friction jams: Coulomb friction has no solution",
    "ambiguous": "Coulomb friction has several solutions: the motion is not determined",
    "stiff": "the integrator's steps became too small",
    "lost": "forward kinematics of the encoders' counts did not converge",
    "no_effort": "the controller found no efforts for its demand",
    "saturated": "a limit of an actuator cuts its effort",
    "overtaxed": "limits leave no efforts for what the controller asks for",
    "speed": "an actuator passes its speed limit",
    "current": "a drive is asked for more than its largest current gives",
    "food_touched": "the teeth touch the food",
    "food_left": "the teeth leave the food",
    "food_broken": "the food breaks",
    "broken": "what the teeth bite on breaks",
    "food_whole": "the food is whole again",
}


MANY = 100  # events of a kind and an owner that are listed
CHATTER = 0.02  # seconds: a limit that is met again within them chatters, which is one event
LIMITS = ("saturated", "overtaxed", "speed", "current")


@dataclass(frozen=True)
class Event:
    """An event of a simulation.

    kind:  of `KINDS`;  owner: name of the chain, contact or load;  text: for people.
    state: independent coordinates and rates there, by name;  ends: whether it ended the run.
    force: of the load, at its point, up to the event [N]; None of what is no load.
    count, duration: how often a chattering limit is met from `time` on, and for how long [s].
    """

    time: float
    kind: str
    text: str
    owner: str = ""
    ends: bool = False
    state: dict[str, float] = field(default_factory=dict)
    force: float | None = None
    count: int = 1
    duration: float = 0.0

    def __str__(self) -> str:
        whose = f' "{self.owner}"' if self.owner else ""
        return f"t = {self.time:.6g} s: {self.kind}{whose}: {self.text}{self.chatter}"

    @property
    def chatter(self) -> str:
        """How often and for how long it is met, empty for once."""
        return f", {self.count} times in {self.duration:.3g} s" if self.count > 1 else ""

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return asdict(self)


class EventLog:
    """Events of a run, at most `MANY` of each kind and owner.

    counts: how many of each, listed or not, one for a limit that chatters.
    """

    def __init__(self, independent: Sequence[str]) -> None:
        """Args: independent: names of the coordinates q, with which states begin."""
        self.names: tuple[str, ...] = (*independent, *(f"d{name}" for name in independent))
        self.events: list[Event] = []
        self.counts: Counter[tuple[str, str]] = Counter()
        self._last: dict[tuple[str, str], int] = {}  # its place in `events`

    def note(
        self,
        t: float,
        y: np.ndarray,
        kind: str,
        text: str,
        owner: str = "",
        ends: bool = False,
        force: float | None = None,
    ) -> None:
        """Add an event at state y, (size,), or once more the last of its limit."""
        place = self._last.get((kind, owner), -1)
        if kind in LIMITS and place >= 0 and not ends:
            last = self.events[place]
            if t - last.time - last.duration < CHATTER:
                self.repeat(kind, owner, 1, t)
                return
        self.counts[kind, owner] += 1
        count = self.counts[kind, owner]
        if count > MANY and not ends:
            return
        if count == MANY and not ends:
            text += "; more of these are not listed"
        state = dict(zip(self.names, y[: len(self.names)].tolist(), strict=True))
        self._last[kind, owner] = len(self.events)
        self.events.append(Event(float(t), kind, text, owner, ends, state, force))

    def has(self, kind: str, owner: str) -> bool:
        """Whether this limit was an event yet."""
        return (kind, owner) in self._last

    def repeat(self, kind: str, owner: str, count: int, until: float) -> None:
        """Add that the limit of the last event was met so many times more, the last `until` [s]."""
        if self.counts[kind, owner] <= MANY:
            place = self._last[kind, owner]
            last = self.events[place]
            count, duration = last.count + count, float(until) - last.time
            self.events[place] = replace(last, count=count, duration=duration)
