"""Words for people. The part of an effort that the load needs is "bite" in older solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..results.solution import Solution

LOAD = "load"
LOAD_PARTS = ("bite", LOAD)


def part_word(part: object) -> str:
    """A part of the mechanism as people call it."""
    name = str(part)
    return LOAD if name in LOAD_PARTS else name.replace("_", " ")


def parts_in_use(solution: Solution) -> list[str]:
    """The parts, without the load where there is none."""
    parts = [str(part) for part in solution["part"].values]
    loads = [part for part in parts if part in LOAD_PARTS]
    idle = [p for p in loads if not np.nan_to_num(solution["share"].sel(part=p).values).any()]
    return [part for part in parts if part not in idle]
