"""Events: what happened in a simulation, when, in which state; some end it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

# What each kind means; in the order in which a page lists them.
KINDS = {
    "bound": "a contact reaches the end of its surface",
    "contact_loss": "a one-sided contact would have to pull",
    "unreachable": "a chain or a contact cannot be closed any more",
    "singular": "the mechanism is singular, and accelerations have no bound",
    "jammed": "friction jams: none or several of its patterns are consistent",
    "stiff": "the integrator's steps became too small",
    "lost": "the encoders' counts no longer give a pose",
    "no_effort": "the controller found no efforts for its demand",
    "saturated": "a limit of an actuator cuts its effort",
    "speed": "an actuator passes its speed limit",
    "food_touched": "the teeth touch the food",
    "food_left": "the teeth leave the food",
    "food_broken": "the food breaks",
    "food_whole": "the food is whole again",
}


@dataclass(frozen=True)
class Event:
    """Something that happened.

    kind:  of `KINDS`;  owner: name of the chain, contact or load;  text: for people.
    state: independent coordinates and rates there, by name;  ends: whether it ended the run.
    """

    time: float
    kind: str
    text: str
    owner: str = ""
    ends: bool = False
    state: dict[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        whose = f' "{self.owner}"' if self.owner else ""
        return f"t = {self.time:.6g} s: {self.kind}{whose}: {self.text}"

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return asdict(self)
