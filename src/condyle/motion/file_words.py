"""Names and cells of files in messages."""

from __future__ import annotations

import os
from collections.abc import Iterable

from ..errors import MANY, printable, shortened


def short(text: str) -> str:
    """The beginning of `text`, fit for a message."""
    return shortened(printable(text, lines=False), 40)


def shown_path(path: str | os.PathLike[str]) -> str:
    """A path in one line: a terminal obeys control characters."""
    return printable(os.fspath(path), lines=False)


def listed(names: Iterable[str], quote: str = '"') -> str:
    """'"a", "b"', or the first ten and how many more there are."""
    names = list(names)
    shown = ", ".join(f"{quote}{short(name)}{quote}" for name in names[:MANY])
    return shown if len(names) <= MANY else f"{shown} and {len(names) - MANY} more"


def columns_are(names: Iterable[str]) -> str:
    """'column "a" is', 'columns "a", "b" are'."""
    names = list(names)
    return f"column {listed(names)} is" if len(names) == 1 else f"columns {listed(names)} are"
