"""Which columns of a file are meant: names with units, spaces and other letters forgiven."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from ..errors import InputError, did_you_mean, join, quoted, short
from ..files import limits
from .column_units import Dimension, dimension, name_and_unit, unit_factor

_ALIASES = {"time": "t", "times": "t"}


@dataclass(frozen=True)
class Header:
    """The columns to read.

    Attributes: index: name -> place in the file, from 0.
                scale: name -> factor to SI, of the columns whose header names a unit.
                ignored: other names, as they stand in the file.
    """

    index: dict[str, int]
    scale: dict[str, float]
    ignored: tuple[str, ...] = ()


def read_header(
    where: str, names: Sequence[str], known: Collection[str] | Mapping[str, Dimension] | None = None
) -> Header:
    """What the names at the head of a table mean. A column without a name ("") has no meaning.

    Args:   known: names to look for; a mapping also says what they measure, where `dimension`
            does not know. None: all names, as they stand.
    Raises: InputError: for names given twice, units that do not fit, and a name that looks like a
            misspelt one of those that are not there.
    """
    stripped = [name.strip() for name in names]
    twice = [name for name, count in Counter(stripped).items() if name and count > 1]
    if twice:
        raise InputError(f"{where}: {columns_are(twice)} given more than once")
    limits.COLUMNS.check(len(names), where)
    longest = max(names, default="", key=len)
    limits.COLUMN_NAME.check(len(longest), f'{where}: "{short(longest)}"')
    present = {name: i for i, name in enumerate(stripped) if name}
    if known is None:
        return Header(present, {})
    index, scale = {name: i for name, i in present.items() if name in known}, dict[str, float]()
    meant: dict[str, str] = {}  # the name in the file, of those that are not spelt as known
    ignored = []
    for text, i in present.items():
        if text in known:
            continue
        stem, unit = name_and_unit(text)
        name = _lookup(stem, known)
        if name is None:
            name, unit = _lookup(text, known), ""
        if name is None or (name in index and name not in meant):
            ignored.append(text)
            continue
        if name in meant:
            raise InputError(f'{where}: columns {quoted([meant[name], text])} both mean "{name}"')
        index[name], meant[name] = i, text
        if unit:
            of = known.get(name) if isinstance(known, Mapping) else None
            column = f'{where}, column "{short(text)}": '
            if (of := of or dimension(name)) is None:
                raise InputError(f"{column}no unit is known for it; leave it out, in SI")
            scale[name] = unit_factor(unit, of, column)
    _refuse_misspelt(where, ignored, [name for name in known if name not in index])
    if not index:
        expected = f"expected some of {join(known)}"
        raise InputError(f"{where}: got the columns {quoted(ignored)}; {expected}")
    order = sorted(index, key=index.__getitem__)
    return Header({name: index[name] for name in order}, scale, tuple(ignored))


def columns_are(names: Iterable[str]) -> str:
    """'column "a" is', 'columns "a", "b" are'."""
    names = list(names)
    return f"column {quoted(names)} is" if len(names) == 1 else f"columns {quoted(names)} are"


def _lookup(name: str, known: Collection[str]) -> str | None:
    if name in known:
        return name
    folded = name.casefold()
    same = [choice for choice in known if choice.casefold() == folded]
    if not same and (alias := _ALIASES.get(folded)) in known:
        return alias
    return same[0] if len(same) == 1 else None


def _refuse_misspelt(where: str, extra: Sequence[str], absent: Sequence[str]) -> None:
    """An extra column is no matter, unless it looks like one that is not there."""
    by_letter: dict[str, list[str]] = {}
    for text in extra:
        by_letter.setdefault(text[0].casefold(), []).append(text)
    for name in absent:
        cutoff = 0.6 if len(name) > 3 else 0.75
        alike = [text for text in by_letter.get(name[0].casefold(), ()) if len(text) < 40]
        if near := get_close_matches(name, alike, 1, cutoff):
            raise InputError(
                f"{where}: {columns_are(near)} not known here.{did_you_mean(near[0], absent)}"
            )
