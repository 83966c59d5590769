"""Mechanisms from files; one message lists all problems of a file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from ..errors import InputError, MechanismError, brief
from .ball_joint import separated
from .chain import CHAINS, Chain
from .contact import Contact
from .coordinates import COORDINATES
from .home import holding_problems, off_surface
from .mechanism import Mechanism, structural_problems
from .messages import describe, of_file, unknown_key
from .quantities import PER_METRE
from .surface import SURFACES
from .table import Table
from .toml import nests_too_deep, read_tables, read_text, too_deep

Kind = TypeVar("Kind", bound=Table)


def load_mechanism(name_or_path: str | os.PathLike[str]) -> Mechanism:
    """Read a mechanism from a TOML file, or a bundled one by its name.

    Raises: MechanismError: with every problem found in the file.
            InputError:     if there is no such file or it is not TOML.
    """
    return parse(read_text(name_or_path), os.fspath(name_or_path))


def as_mechanism(given: Any) -> Mechanism:
    """The mechanism given: itself, a model's, or one by the path of its file or its bundled name.

    Raises: InputError: for anything else; errors of `load_mechanism`.
    """
    mechanism = getattr(given, "mechanism", given)
    if isinstance(mechanism, Mechanism):
        return mechanism
    if isinstance(given, str | os.PathLike):
        return load_mechanism(given)
    raise InputError(
        "mechanism: expected a mechanism, a model, the path of a mechanism file or the name of a "
        f"bundled mechanism, got {type(given).__name__}"
    )


def parse(text: str, source: str = "mechanism") -> Mechanism:
    """A mechanism from the text of a file; `source` names it in messages."""
    return from_data(read_tables(text, source), source)


def recall(text: str, source: str = "mechanism") -> Mechanism:
    """The mechanism of a solution, from what `record` made of it.

    A surface from Python comes back as an `UnknownSurface`, which can be shown but not computed
    with.
    """
    return _recalled(text, source, (*SURFACES.values(), *CHAINS.values()))


@lru_cache(4)  # a page asks its solution some two hundred times, at 15 ms of reading each
def _recalled(text: str, source: str, kinds: tuple[type[Table], ...]) -> Mechanism:
    """Args: kinds: that a file may name now."""
    return from_data(read_tables(text, source), source, at_home=False, notes=True)


def validated(
    kind: type[Kind], data: Any, source: str, what: str, context: dict[str, Any]
) -> tuple[Kind | None, list[str], dict[str, Any]]:
    """A table, None if it is not valid; what is wrong with it; and its `data` but `length_unit`.

    Args:   context: of the validation, to which units a metre are added.
    Raises: InputError: for anything but tables.
    """
    if not isinstance(data, Mapping):
        raise InputError(f"{source}: expected the tables of a {what}, got {brief(data)}")
    if nests_too_deep(data):
        raise too_deep(source)
    tables, problems, parsed = dict(data), list[str](), None
    unit = tables.pop("length_unit", "m")
    if not isinstance(unit, str) or unit not in PER_METRE:
        problems.append(f'length_unit: expected "m" or "mm", got {brief(unit)}')
        unit = "m"
    context["per_metre"] = PER_METRE[unit]
    # Names that Python has for a key of the file are no keys of the file.
    fields = kind.model_fields.items()
    aliased = {name: field.alias for name, field in fields if field.alias and name in tables}
    for name, key in aliased.items():
        tables.setdefault(key, tables.pop(name))
    try:
        parsed = kind.model_validate(tables, context=context)
    except ValidationError as error:
        problems += describe(error, tables, kind)
    problems += [f"{name}: {unknown_key(name, (), kind)}" for name in aliased]
    return parsed, problems, tables


def from_data(
    data: Mapping[str, Any],
    source: str = "mechanism",
    at_home: bool = True,
    notes: bool = False,
) -> Mechanism:
    """A mechanism from the tables of a file, lengths in its `length_unit`.

    Args: at_home: whether the contacts must be on their surfaces and hold the platform.
          notes: whether a note may stand in the place of a surface, as `record` leaves it.
    """
    context = {"notes": notes, "at_home": False}
    if isinstance(data, Mapping) and "contact" in data:
        data = {**data, "contact": separated(data["contact"])}
    mechanism, problems, data = validated(Mechanism, data, source, "mechanism", context)
    if mechanism is None:
        structural = list(structural_problems(data))
        problems = structural + [p for p in problems if not any(s in p for s in structural)]
    problems += _contact_problems(data, context) if at_home else ()
    if problems or mechanism is None:
        raise MechanismError(source, of_file(problems, data, Mechanism, source))
    return mechanism


@dataclass(frozen=True)
class _Draft:
    """The valid parts of a mechanism."""

    contacts: tuple[Contact, ...]
    chains: tuple[Chain, ...]
    dependent: tuple[str, ...] | None


def _contact_problems(data: Mapping[str, Any], context: Mapping[str, Any]) -> Iterator[str]:
    """Contacts that are off their surface at home or cannot hold the platform.

    They are found also where other parts of the file are not valid yet.
    """
    parsed = _valid(Contact, data.get("contact"), context)
    contacts = tuple(contact for contact in parsed if contact is not None)
    chains = tuple(c for c in _valid(Chain, data.get("chain"), context) if c is not None)
    off = list(off_surface(contacts))
    yield from off
    if off or None in parsed or len(contacts) > 5 or not chains:
        return
    given = data.get("dependent")
    names = tuple(n for n in COORDINATES if n in given) if isinstance(given, list) else ()
    valid = isinstance(given, list) and len(names) == len(given) == len(contacts)
    ordered = tuple(sorted(names, key=given.index)) if valid and given else None
    yield from holding_problems(_Draft(contacts, chains, ordered))


def _valid(kind: Any, tables: Any, context: Mapping[str, Any]) -> list[Any]:
    """Each table as a `kind`, None where it is not valid."""
    adapter, parsed = TypeAdapter(kind), []
    for table in tables if isinstance(tables, list) else ():
        try:
            parsed.append(adapter.validate_python(table, context=dict(context)))
        except ValidationError:
            parsed.append(None)
    return parsed
