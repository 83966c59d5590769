"""Reading files, and showing their names and cells in messages."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable

from ..errors import MANY, InputError, as_path, printable, require_file, shortened
from ..limits import RECORDING, WorkLimit


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


def content_of(path: str | os.PathLike[str], most: WorkLimit = RECORDING) -> bytes:
    """The bytes of a file.

    Raises: InputError: if it cannot be read, or has more than `most`.
    """
    require_file(path := as_path(path))
    most.check(os.path.getsize(path), path)
    try:
        with open(path, "rb") as file:
            return file.read(most.most)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def digest(path: str | os.PathLike[str]) -> str | None:
    """SHA-256 of a file in hexadecimal; None for a pipe, which can be read only once."""
    if not os.path.isfile(path):
        return None
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
