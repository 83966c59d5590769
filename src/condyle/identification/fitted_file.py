"""A mechanism's file with some numbers changed, and all else as a person wrote it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..atomic import write_text
from ..extras import require
from ..mechanism.mechanism import Mechanism
from ..mechanism.paths import parsed, value_at
from ..mechanism.toml import read_text
from ..mechanism.writing import dumps
from ..version import __version__

MILLIMETRE = 1e-3


def write_fitted(
    source: Mechanism | str | os.PathLike[str],
    mechanism: Mechanism,
    paths: Mapping[str, str],
    path: str | os.PathLike[str],
    header: str,
) -> None:
    """Write a fitted mechanism into its file's text, comments kept.

    Args: source: the file that it comes from, or a mechanism, which has no text;
          mechanism: with the fitted numbers;  paths: of these numbers, with their units;
          header: lines for the top.
    """
    require("tomlkit", "identify")
    import tomlkit

    text = dumps(source) if isinstance(source, Mechanism) else read_text(source)
    document = tomlkit.parse(text)
    unit = MILLIMETRE if document.get("length_unit", "m") == "mm" else 1.0
    for whole in dict.fromkeys(one.partition("[")[0] for one in paths):
        own = next(u for p, u in paths.items() if p.partition("[")[0] == whole)
        _put(document, parsed(whole), value_at(mechanism, whole), unit if own == "m" else 1.0)
    for line in reversed([f"condyle {__version__}", *header.splitlines()]):
        document.body.insert(0, (None, tomlkit.comment(line)))
    written = tomlkit.dumps(document)
    write_text(Path(path), written)


def _put(document: Any, keys: tuple[Any, ...], value: Any, unit: float) -> None:
    """Set an entry, making the tables that it stands in."""
    import tomlkit

    here = document
    if keys[0] in ("chain", "contact"):
        name = keys[1]
        here = next(table for table in document[keys[0]] if table["name"] == name)
        keys = keys[2:]
    for key in keys[:-1]:
        if key not in here:
            here[key] = tomlkit.inline_table()
        here = here[key]
    numbers = [x / unit for x in value] if isinstance(value, tuple | list) else value / unit
    here[keys[-1]] = numbers
