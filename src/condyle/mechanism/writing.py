"""Mechanisms as TOML: files of people, and the record that a solution keeps."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from ..errors import InputError
from .ball_joint import joined, of_joints
from .files import as_mechanism
from .mechanism import Mechanism
from .surface import UnknownSurface
from .table import Table


def dump(mechanism: Mechanism | str | os.PathLike[str], path: str | os.PathLike[str]) -> None:
    """Write the mechanism as a TOML file in SI, completely or not at all."""
    from ..files.atomic import write_text

    write_text(path, dumps(mechanism))


def dumps(mechanism: Mechanism | str | os.PathLike[str]) -> str:
    """The mechanism as a TOML file in SI; `parse(dumps(m)) == m` to the last bit.

    Raises: InputError: if a surface is a Python expression, which a file cannot hold.
    """
    mechanism = as_mechanism(mechanism)
    if names := written_in_python(mechanism):
        raise InputError(
            f"{mechanism.name}: the surface of {', '.join(names)} is a Python expression; a "
            "mechanism file holds kinds and numbers only. Use a kind of surface instead"
        )
    return _toml(mechanism)


def record(mechanism: Mechanism) -> str:
    """The mechanism as a solution keeps it: as `dumps`, with notes of surfaces from Python."""
    python = written_in_python(mechanism)
    if not python:
        return dumps(mechanism)
    note = f"# The surface of {', '.join(python)} was written in Python; a file cannot hold it.\n"
    return note + _toml(mechanism)


def written_in_python(mechanism: Mechanism) -> list[str]:
    """Names of contacts whose surface is, or was, a Python expression."""
    return [c.name for c in mechanism.contacts if c.surface.kind == UnknownSurface.kind]


def _toml(mechanism: Mechanism) -> str:
    import tomli_w

    plain = {"length_unit": "m", **_plain(mechanism)}
    if of_joints(mechanism.contacts):
        plain["contact"] = _plain(joined(mechanism.contacts))
    return tomli_w.dumps(plain)


def _plain(value: Any) -> Any:
    """Tables and lists as TOML has them, without what is None, implied, or an empty table."""
    if getattr(value, "kind", None) == UnknownSurface.kind:
        return {"kind": UnknownSurface.kind, "closed": value.closed}
    if isinstance(value, Table):
        fields = {field.alias or n: field for n, field in type(value).model_fields.items()}
        entries = value.entries()
        value = {
            key: item
            for key, item in entries.items()
            if not (key in value.implied and item == fields[key].default)
        }
    if isinstance(value, Mapping):
        kept = {key: _plain(item) for key, item in value.items() if item is not None}
        return {key: item for key, item in kept.items() if item != {}}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
