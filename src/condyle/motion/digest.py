"""Which file it was: the hash that a solution keeps of its inputs."""

from __future__ import annotations

import hashlib
import os


def digest(path: str | os.PathLike[str]) -> str | None:
    """SHA-256 of a file in hexadecimal; None for a pipe, which can be read only once."""
    if not os.path.isfile(path):
        return None
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
