"""Places in a mechanism, by the names of its file: `chain.masseter_left.base[2]`.

    platform.mass    gravity[2]    platform.points.incisor    contact.left_condyle.surface.offset

A place is a row of keys. Chains and contacts go by their name, or by their number as in `chain[0]`;
entries of lists by their number from 0. A name with a dot or a bracket stands in quotes, as in
`chain."a.b".base`. Values are SI, whatever unit the file has for lengths.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, NoReturn

from pydantic import BaseModel

from ..errors import InputError, brief, did_you_mean, short, shortened
from .messages import entry
from .quantities import listed
from .surface import Expression
from .table import Table
from .table_schema import SIDE_OPTIONS

Path = tuple[str | int, ...]

_STEP = re.compile(r'\[(?P<index>\d{1,6})\]|\.?\s*"(?P<quoted>[^"]*)"|\.?(?P<key>[^.\[\]"]+)')


def parsed(path: str) -> Path:
    """The keys of a path, ("chain", "masseter_left", "base", 2).

    Raises: InputError: for anything else.
    """
    if not isinstance(path, str):
        raise InputError(f'path: expected text such as "platform.mass", got {brief(path)}')
    keys: list[str | int] = []
    at = 0
    while match := _STEP.match(path, at):
        if match["index"] is not None:
            keys.append(int(match["index"]))
        else:
            keys.append(match["quoted"] if match["quoted"] is not None else match["key"].strip())
        at = match.end()
    if at < len(path) or not keys or path.startswith((".", "[")):
        raise InputError(
            "path: expected one such as platform.mass, chain.masseter_left.base[2] or "
            f"contact.left_condyle.surface.offset, got {brief(path)}"
        )
    return tuple(keys)


def value_at(table: Table, path: str) -> Any:
    """The value at a place: a number, text, a tuple or a table; None where it is left out.

    Raises: InputError: if there is no such path.
    """
    here: Any = table
    keys = parsed(path)
    for depth, key in enumerate(keys):
        here = _child(here, key, keys[:depth])
    return here


def changed(table: Table, values: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of a table with other values at some places, not validated yet.

    Raises: InputError: for anything else, or for paths of which one contains another.
    """
    places = {parsed(path): listed(value) for path, value in values.items()}
    result: Any = table
    for keys, value in places.items():
        if within := [k for k in places if k != keys and k[: len(keys)] == keys]:
            raise InputError(f"{written(within[0])} is within {written(keys)}; give one of them")
        result = _put(result, keys, 0, value)
    return dict(result.entries() if isinstance(result, Table) else result)


def written(keys: Iterable[str | int]) -> str:
    """A path as text."""
    text = ""
    for key in keys:
        if isinstance(key, int):
            text += f"[{key}]"
        else:
            plain = _STEP.fullmatch(key) and "[" not in key and not key.startswith((".", " "))
            text += ("." if text else "") + (key if plain else f'"{key}"')
    return short(text, 120)


def _put(here: Any, keys: Path, depth: int, value: Any) -> Any:
    """`here` with another value at keys[depth:], as tables and lists of a file."""
    if depth == len(keys):
        return value
    key, above = keys[depth], keys[:depth]
    new = depth + 1 == len(keys) and _free(above)
    child = None if new else _child(here, key, above)
    below = _put(child, keys, depth + 1, value)
    if isinstance(here, list | tuple):
        index = key if isinstance(key, int) else _names(here).index(key)
        return [*here[:index], below, *here[index + 1 :]]
    if isinstance(here, Expression):
        return replace(here, offset=below)
    return {**(here.entries() if isinstance(here, Table) else here), key: below}


def _free(keys: Path) -> bool:
    """Whether a table has keys of the user's."""
    return keys == ("platform", "points")


def _child(here: Any, key: str | int, above: Path) -> Any:
    if isinstance(here, list | tuple):
        return _item(here, key, above)
    if isinstance(here, Table):
        entries: Mapping[str, Any] = here.entries()
    elif isinstance(here, Expression):
        entries = {"offset": here.offset}
    elif isinstance(here, Mapping):
        entries = here
    else:
        _refuse(above, key, f"{written(above)} is {brief(here)}, which has no entries")
    if isinstance(key, int):
        _refuse(above, key, f"{_called(above)} is a table, not a list.{did_you_mean('', entries)}")
    if key not in entries:
        hint = did_you_mean(key, entries)
        if key in SIDE_OPTIONS and above[-1:] == ("surface",):
            hint = f" It is a key of the contact: {written((*above[:-1], key))}."
        elif key == "length_unit":
            hint = " Values in Python are SI, lengths in m."
        _refuse(above, key, f'{_called(above)} has no "{shortened(key, 80)}".{hint}')
    return entries[key]


def _item(here: list[Any] | tuple[Any, ...], key: str | int, above: Path) -> Any:
    names = _names(here)
    if isinstance(key, int):
        if key >= len(here):
            entries = f"{len(here)} entries, [0] to [{len(here) - 1}]" if here else "no entries"
            _refuse(above, key, f"{written(above)} has {entries}")
        return here[key]
    if not names:
        _refuse(above, key, f"{written(above)} is a list; its entries are {written(above)}[0] ...")
    if key not in names:
        name = shortened(key, 80)
        _refuse(above, key, f'no {written(above)} is called "{name}".{did_you_mean(key, names)}')
    return here[names.index(key)]


def _names(items: Iterable[Any]) -> list[str]:
    """Names of the tables in a list, if they have names."""
    found = [entry(item, "name") for item in items]
    named = all(isinstance(item, BaseModel | Mapping) for item in items)
    return [str(name) for name in found] if named else []


def _called(keys: Path) -> str:
    return written(keys) if keys else "a mechanism"


def _refuse(above: Path, key: str | int, problem: str) -> NoReturn:
    raise InputError(f"{written((*above, key))}: {problem}")
