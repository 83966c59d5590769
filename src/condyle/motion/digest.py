"""Which file it was: the hash that a solution keeps of its inputs."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path


def digest(path: str | os.PathLike[str]) -> str | None:
    """SHA-256 of a file in hexadecimal; None for a pipe, which can be read only once."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest() if os.path.isfile(path) else None
