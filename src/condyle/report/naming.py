"""Names as people read them, and which chains stand together: a left and a right one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

LOAD = "load"
_SIDE = re.compile(r"(?<![a-zA-Z])(left|right|l|r)(?![a-zA-Z])", re.IGNORECASE)
LOAD_PARTS = ("bite", LOAD)  # the part of an effort that the load needs; "bite" in older files
MAY_BE_IDLE = (*LOAD_PARTS, "friction", "internal")


def stem(name: str) -> str:
    """The name without its side: the same for masseter_left and masseter_right."""
    return _SIDE.sub("", name)


def side(name: str) -> str:
    """'left' of masseter_left; empty where a name has no side."""
    found = _SIDE.search(name)
    return found[0] if found else ""


def readable(name: str) -> str:
    """A name from a file as words."""
    return str(name).replace("_", " ")


def heading(names: Sequence[str]) -> str:
    """What the chains of one panel have in common, or all their names."""
    stems = {stem(name) for name in names}
    if len(names) > 1 and len(stems) == 1:
        return readable(stems.pop()).strip() or ", ".join(map(readable, names))
    return ", ".join(map(readable, names))


def short(names: Sequence[str]) -> list[str]:
    """What tells the chains of one panel apart where `heading` says the rest."""
    if len(names) > 1 and len({stem(name) for name in names}) == 1:
        return [side(name) or name for name in names]
    return list(map(readable, names))


def groups(names: Sequence[str], units: Sequence[str]) -> list[list[int]]:
    """Indices of the chains that share a panel: left and right of a pair, the others two by two.

    Chains of different units never share one.
    """
    keys = [(stem(name), unit) for name, unit in zip(names, units, strict=True)]
    pairs: list[list[int]] = []
    lone: dict[str, list[int]] = {}
    for key in dict.fromkeys(keys):
        members = [i for i, k in enumerate(keys) if k == key]
        if len(members) > 1:
            pairs.append(members)
        else:
            lone.setdefault(key[1], []).extend(members)
    for alone in lone.values():
        pairs += [alone[j : j + 2] for j in range(0, len(alone), 2)]
    return sorted(pairs)


def by_unit(units: Sequence[str]) -> dict[str, list[int]]:
    """Unit -> indices of its chains."""
    return {unit: [i for i, u in enumerate(units) if u == unit] for unit in dict.fromkeys(units)}


def bite_sides(solution: xr.Dataset) -> dict[str, str]:
    """Contact -> "working side" or "balancing side" of a jaw that bites on one side; else none."""
    mechanism = solution.condyle.mechanism
    bite = mechanism.platform.points.get(solution.condyle.options.get("load_point"))
    if mechanism.vocabulary != "jaw" or bite is None or not np.nan_to_num(solution["load"]).any():
        return {}
    across = {c.name: c.point[1] * bite[1] for c in mechanism.contacts}
    words = {True: "working side", False: "balancing side"}
    return {name: words[y > 0] for name, y in across.items() if y}


def part_word(part: object) -> str:
    """A part of the mechanism as people call it."""
    return LOAD if str(part) in LOAD_PARTS else readable(str(part))


def parts_in_use(solution: xr.Dataset) -> list[str]:
    """The parts, without load, friction and internal efforts that are 0."""
    parts, share = [str(part) for part in solution["part"].values], solution["share"].values
    return [
        part
        for i, part in enumerate(parts)
        if part not in MAY_BE_IDLE or np.nan_to_num(share[i]).any()
    ]
