"""Reading files that may be anybody's: bounded in size, no device or pipe, links followed."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from ..errors import InputError, as_path, nearest, printable
from .limits import RECORDING, WorkLimit

# Of a command that runs: what it has read, by real path, so that it replaces none of it.
READ: ContextVar[set[str] | None] = ContextVar("READ", default=None)


@contextmanager
def sparing(paths: Iterable[str | os.PathLike[str]]) -> Iterator[None]:
    """Neither these files nor others that are read within the block are replaced within it."""
    token = READ.set(set(map(os.path.realpath, paths)))
    try:
        yield
    finally:
        READ.reset(token)


def note_read(path: str | os.PathLike[str]) -> None:
    """Note a file as read: within `sparing`, `atomic.check_writable` refuses it from now on."""
    if (read := READ.get()) is not None:
        read.add(os.path.realpath(path))


def require_file(path: str | os.PathLike[str]) -> None:
    """Refuse what could be read for ever, or waited for; what is left is noted as read.

    Raises: InputError: for what is not there, a folder, a device or a pipe.
    """
    if not os.path.exists(path):
        raise no_such_file(path)
    if not os.path.isfile(path):
        what = "a folder" if os.path.isdir(path) else "a device or a pipe"
        raise InputError(f"{path}: is {what}; expected a file")
    note_read(path)


def no_such_file(path: str | os.PathLike[str]) -> InputError:
    """The error for a file that is not there, with names like it in its folder."""
    folder = Path(path).parent.resolve()
    if not folder.is_dir():
        return InputError(f"{path}: no such file; the folder {folder} does not exist")
    near = nearest(Path(path).name, os.listdir(folder))
    hint = f"Did you mean {' or '.join(near)}?" if near else ""
    return InputError(f"{path}: no such file in {folder}.", hint)


def printable_path(path: str | os.PathLike[str]) -> str:
    """A path in one line: a terminal obeys control characters."""
    return printable(os.fspath(path), lines=False)


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


def text_of(path: str | os.PathLike[str], most: WorkLimit = RECORDING) -> str:
    """The text of a file in UTF-8, with or without byte order mark.

    Raises: InputError: also if it is none.
    """
    try:
        return content_of(path, most).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not a text file (UTF-8 expected)") from None


def digest(path: str | os.PathLike[str]) -> str | None:
    """SHA-256 of a file in hexadecimal; None for a pipe, which can be read only once.

    Raises: InputError: if it cannot be read.
    """
    if not os.path.isfile(path):
        return None
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
