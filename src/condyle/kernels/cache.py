"""Built kernels on disk, found by everything that went into them.

An entry is a shared library, named by its recipe and by its own content, and a manifest that
names the library. Both appear by renaming, the manifest last, so that processes may race and may
be killed at any time: a manifest always stands for a whole library, and a library that is not
what its manifest says is never loaded.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import platformdirs

STALE_SECONDS = 3600  # a folder of a killed build is cleared after this


@dataclass(frozen=True)
class Entry:
    """A library that is safe to load, and what is known of it."""

    library: Path
    facts: dict[str, Any]
    cached: bool


@dataclass(frozen=True)
class Contents:
    """What a cache holds."""

    folder: Path
    kernels: int
    size: int


def cache_folder() -> Path:
    """Where kernels are kept: `CONDYLE_CACHE`, else the user's cache folder."""
    if chosen := os.environ.get("CONDYLE_CACHE"):
        return Path(chosen)
    return Path(platformdirs.user_cache_dir("condyle")) / "kernels"


def digest(*parts: str | bytes) -> str:
    """Name of a recipe: a hash of everything that matters, each part apart."""
    h = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        h.update(len(data).to_bytes(8, "little"))
        h.update(data)
    return h.hexdigest()[:40]


def find(recipe: str) -> Entry | None:
    """The kernel of a recipe, if it is there and whole."""
    folder = cache_folder()
    if not _trusted(folder):
        return None
    try:
        facts = json.loads((folder / f"{recipe}.json").read_text(encoding="utf-8"))
        library = folder / facts["library"]
        if library.parent != folder or _hash(library) != facts["sha256"]:
            return None
        return Entry(library, facts, True)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def build(
    recipe: str, make: Callable[[Path], tuple[Path, dict[str, Any]]], say: Callable[[str], None]
) -> Entry:
    """Build a kernel and keep it; where nothing can be kept, build it in a temporary folder.

    Args:   make: builds in an empty folder and returns the library and facts about it.
            say:  told when the cache cannot be used.
    Raises: OSError: if there is no place to build at all; what `make` raises.
    """
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not _trusted(folder):
            raise PermissionError(f"{folder} belongs to or can be written by others")
        _sweep(folder)
        with tempfile.TemporaryDirectory(prefix="build-", dir=folder) as name:
            library, facts = make(Path(name))
            facts["sha256"] = _hash(library)
            facts["library"] = f"{recipe}-{facts['sha256'][:16]}.so"
            manifest = Path(name) / "manifest.json"
            manifest.write_text(json.dumps(facts), encoding="utf-8")
            os.replace(library, folder / facts["library"])
            os.replace(manifest, folder / f"{recipe}.json")
        return Entry(folder / facts["library"], facts, False)
    except OSError as error:
        say(f"the kernel cache cannot be used ({error}); building for this process alone")
    place = Path(tempfile.mkdtemp(prefix="condyle-"))
    try:
        library, facts = make(place)
    except BaseException:
        shutil.rmtree(place, ignore_errors=True)
        raise
    return Entry(library, facts, False)


def contents() -> Contents:
    """How many kernels there are and what they take [bytes]."""
    folder = cache_folder()
    files = [f for f in folder.glob("*") if f.is_file()] if folder.is_dir() else []
    return Contents(
        folder, sum(f.suffix == ".json" for f in files), sum(f.stat().st_size for f in files)
    )


def clear() -> Contents:
    """Remove every kernel; returns what there was."""
    had = contents()
    if had.folder.is_dir():
        for path in had.folder.iterdir():
            if path.is_dir() and path.name.startswith("build-"):
                shutil.rmtree(path, ignore_errors=True)
            elif path.suffix in (".so", ".json"):
                path.unlink(missing_ok=True)
    return had


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _trusted(folder: Path) -> bool:
    """Whether nobody else can put libraries there."""
    if not hasattr(os, "getuid"):
        return folder.is_dir()
    try:
        about = folder.stat()
    except OSError:
        return False
    mine = about.st_uid == os.getuid()
    return mine and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _sweep(folder: Path) -> None:
    """Remove what killed builds left behind."""
    for path in folder.glob("build-*"):
        try:
            if time.time() - path.stat().st_mtime > STALE_SECONDS:
                shutil.rmtree(path, ignore_errors=True)
        except OSError:
            continue
