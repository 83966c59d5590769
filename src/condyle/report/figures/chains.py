"""Which chains share a panel, a colour, a unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..words import side, stem
from .style import look


def groups(names: Sequence[str], units: Sequence[str]) -> list[list[int]]:
    """Indices of the chains that share a panel: left and right of a pair, the others two by two.

    Chains of different units never share one.
    """
    keys = [(stem(name), unit) for name, unit in zip(names, units, strict=True)]
    found: list[list[int]] = []
    lone: list[list[int]] = []
    for key in dict.fromkeys(keys):
        members = [i for i, k in enumerate(keys) if k == key]
        (found if len(members) > 1 else lone).append(members)
    for members in by_unit([units[i] for (i,) in lone]).values():
        alone = [lone[j][0] for j in members]
        found += [alone[j : j + 2] for j in range(0, len(alone), 2)]
    return sorted(found)


def by_unit(units: Sequence[str]) -> dict[str, list[int]]:
    """Unit -> indices of its chains."""
    return {unit: [i for i, u in enumerate(units) if u == unit] for unit in dict.fromkeys(units)}


def styles(names: Sequence[str]) -> list[dict[str, Any]]:
    """A line style for each name: a pair has one colour, and every line dashes of its own."""
    stems = list(dict.fromkeys(map(stem, names)))
    return [look(stems.index(stem(name)), i) for i, name in enumerate(names)]


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
        return [side(name) for name in names]
    return list(map(readable, names))
