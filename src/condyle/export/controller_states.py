"""The state machine of an exported controller as data: C, documentation and tests read it here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

STATES = {
    "OFF": "no efforts, drives disabled; encoders are read",
    "HOMING": "to its marks, where it has to find them, and to the reference, smoothly",
    "HOLD": "stays where homing went, or where the reference was left",
    "RUN": "follows the reference",
    "SAFE_STOP": "holds the pose or brakes, lets efforts go, then off",
}
EVENTS = {
    "WANT_OFF": "`wanted` is off",
    "WANT_HOLD": "`wanted` is hold",
    "WANT_RUN": "`wanted` is run",
    "WANT_STOP": "`wanted` is stop, or has no meaning",
    "DONE": "homing has arrived, or the stop has ended",
    "FAULT": "a fault that stops",
    "CUT": "a fault of the drives",
}
NEXT = {
    "OFF": ("OFF", "HOMING", "HOMING", "OFF", "OFF", "OFF", "OFF"),
    "HOMING": ("SAFE_STOP", "HOMING", "HOMING", "SAFE_STOP", "HOLD", "SAFE_STOP", "OFF"),
    "HOLD": ("SAFE_STOP", "HOLD", "RUN", "SAFE_STOP", "HOLD", "SAFE_STOP", "OFF"),
    "RUN": ("SAFE_STOP", "HOLD", "RUN", "SAFE_STOP", "RUN", "SAFE_STOP", "OFF"),
    "SAFE_STOP": ("SAFE_STOP", "SAFE_STOP", "SAFE_STOP", "SAFE_STOP", "OFF", "SAFE_STOP", "OFF"),
}


INPUTS = {
    "lost": "this encoder has no reading",
    "inhibit": "motion is not permitted",
    "drive_fault": "a drive reports a fault",
    "e_stop": "emergency stop",
    "index": "this encoder's mark has passed since the last tick",
}


class Cause(NamedTuple):
    """Why a controller stops.

    text: what happened;  key: of `[safety]`, or input, that decides;  holds: whether the law can
    still be trusted to hold the pose, where `[safety] stop` asks for that.
    """

    text: str
    key: str
    holds: bool = False


CAUSES = {
    "FINE": Cause("no fault", "", holds=True),
    "LATE": Cause("ticks come late, or the clock stands still or jumps", "late, late_most, gap"),
    "LOST": Cause("encoders have no reading", "lost_most"),
    "NO_POSE": Cause("the tick has no result: no pose from the joints", "lost_most"),
    "TRACKING": Cause("a joint is far from its reference", "trips.tracking"),
    "SPEED": Cause("a joint is too fast", "trips.speed"),
    "OVERTAXED": Cause("an effort stands at its limit", "trips.overtaxed", holds=True),
    "CONTACT": Cause("a contact carries nothing", "trips.contact", holds=True),
    "ENCODER": Cause("a reading jumps or sticks", "trips.encoder_jump, trips.encoder_stuck"),
    "INHIBIT": Cause(f"input: {INPUTS['inhibit']}", "inhibit", holds=True),
    "DRIVE_FAULT": Cause(f"input: {INPUTS['drive_fault']}", "drive_fault"),
    "E_STOP": Cause(f"input: {INPUTS['e_stop']}", "e_stop"),
    "NO_MARK": Cause("no mark or stop where it should be", "search.within, search.tolerance"),
}


def c_states(prefix: str) -> dict[str, str]:
    """What `c_controller.c` and `.h` take from here, by the name of its place in them.

    Args: prefix: of the names of constants.
    """
    rows = (f"    {{{', '.join(f'{prefix}_{to}' for to in row)}}}," for row in NEXT.values())
    holds = (f"1u << {prefix}_{name}" for name, cause in CAUSES.items() if cause.holds)
    return {
        "states": _enumerators(prefix, STATES),
        "events": ", ".join(f"{name} = {i}" for i, name in enumerate(EVENTS) if i > 3),
        "next": "\n".join(rows),
        "causes": _enumerators(prefix, {name: cause.text for name, cause in CAUSES.items()}),
        "holds": " | ".join(holds),
        **INPUTS,
    }


def _enumerators(prefix: str, texts: Mapping[str, str]) -> str:
    commas = [","] * (len(texts) - 1) + [""]
    rows = zip(texts.items(), commas, strict=True)
    return "\n".join(f"    {prefix}_{name}{comma} /* {text} */" for (name, text), comma in rows)


def states_page() -> str:
    """Every state, input and fault, as tables of the documentation."""
    head = "| from \\ event | " + " | ".join(f"`{event}`" for event in EVENTS) + " |"
    lines = [head, "|---" * (len(EVENTS) + 1) + "|"]
    for state, row in NEXT.items():
        cells = ("" if to == state else f"`{to}`" for to in row)
        lines.append(f"| **`{state}`** | " + " | ".join(cells) + " |")
    lines += ["", "| state | meaning |", "|---|---|"]
    lines += [f"| `{name}` | {text} |" for name, text in STATES.items()]
    lines += ["", "| event | meaning |", "|---|---|"]
    lines += [f"| `{name}` | {text} |" for name, text in EVENTS.items()]
    lines += ["", "| input of `measured` | not 0 |", "|---|---|"]
    lines += [f"| `{name}` | {text} |" for name, text in INPUTS.items()]
    lines += ["", "| fault | value | meaning | decided by | may hold the pose |", "|---" * 5 + "|"]
    for value, (name, cause) in enumerate(CAUSES.items()):
        keys = ", ".join(f"`{key}`" for key in cause.key.split(", ") if key)
        holds = "yes" if cause.holds else "no"
        lines.append(f"| `{name}` | {value} | {cause.text} | {keys} | {holds} |")
    return "\n".join(lines) + "\n"
