"""Files that are read: their bytes, or why not, and the hash that a solution keeps of them."""

from __future__ import annotations

import hashlib
import os

from ..errors import InputError, no_such_file
from .file_words import short


def content_of(path: str | os.PathLike[str], most: int = -1) -> bytes:
    """The bytes of a file, or so many of them.

    Raises: InputError: if it cannot be read.
    """
    try:
        with open(path, "rb") as file:
            return file.read(most)
    except FileNotFoundError:
        raise no_such_file(path) from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{short(os.fspath(path))}: cannot be read ({why})") from None


def digest(path: str | os.PathLike[str]) -> str | None:
    """SHA-256 of a file in hexadecimal; None for a pipe, which can be read only once."""
    if not os.path.isfile(path):
        return None
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
