"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from condyle.errors import InputError


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Lend a temporary path in the folder of `path`; rename it to `path` when the block succeeds.

    On any exception the temporary file is removed and what stood at `path` is untouched. A link
    is followed; a device or pipe cannot be renamed to, so that one is lent itself.

    Raises: InputError: if `path` cannot be written, a full disk inside the block included.
    """
    target = _checked(path)
    direct = target.exists() and not target.is_file()
    name = f".{target.name[:100]}.{os.getpid()}-{secrets.token_hex(4)}.part"
    temporary = target if direct else target.with_name(name)
    try:
        try:
            yield temporary
            if not direct:
                os.replace(temporary, target)
        finally:
            if not direct:
                temporary.unlink(missing_ok=True)
    except OSError as error:
        if error.filename is not None and str(error.filename) != str(temporary):
            raise  # another file's trouble
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error


def _checked(path: str | os.PathLike[str]) -> Path:
    if "\0" in os.fspath(path):
        raise InputError(f"{os.fspath(path)!r}: is not the name of a file")
    if os.path.isdir(path):
        raise InputError(f"{path}: is a folder; give the name of a file to write")
    if os.path.exists(path) and not os.path.isfile(path):
        return Path(path)
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise InputError(f"{path}: the folder {target.parent} does not exist; create it first")
    return target


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
