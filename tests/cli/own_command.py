"""A command of one's own, as a package beside condyle has it."""

from typing import Literal

import condyle
from condyle.cli.answer import Answer, command_line
from condyle.cli.command import command


@command("weigh jaw.toml --unit g")
def weigh(mechanism: str, *, unit: Literal["kg", "g"] = "kg", twice: bool = False) -> Answer:
    """Mass of the platform [kg].

    Args:
        unit: kg or [g].
        twice: As of two of them.
    """
    mass = condyle.load_mechanism(mechanism).get("platform.mass") * (1 + twice)
    text = f"{mass * {'kg': 1, 'g': 1e3}[unit]:g} {unit}"
    return Answer(text, {"mass": mass}, command_line("check", mechanism), "result")
