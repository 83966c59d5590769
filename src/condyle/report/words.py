"""Words for people. The part of an effort that the load needs is "bite" in older solutions."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..results.solution import Solution

LOAD = "load"
_SIDE = re.compile(r"(?<![a-zA-Z])(left|right|l|r)(?![a-zA-Z])", re.IGNORECASE)
LOAD_PARTS = ("bite", LOAD)
MAY_BE_IDLE = (*LOAD_PARTS, "friction", "internal")


def stem(name: str) -> str:
    """The name without its side: the same for masseter_left and masseter_right."""
    return _SIDE.sub("", name)


def side(name: str) -> str:
    """'left' of masseter_left; empty where a name has no side."""
    found = _SIDE.search(name)
    return found[0] if found else ""


def part_word(part: object) -> str:
    """A part of the mechanism as people call it."""
    name = str(part)
    return LOAD if name in LOAD_PARTS else name.replace("_", " ")


def parts_in_use(solution: Solution) -> list[str]:
    """The parts, without load, friction and internal efforts that are 0."""
    parts = [str(part) for part in solution["part"].values]
    share = solution["share"].values
    idle = [
        p for i, p in enumerate(parts) if p in MAY_BE_IDLE and not np.nan_to_num(share[i]).any()
    ]
    return [part for part in parts if part not in idle]
