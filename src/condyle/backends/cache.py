"""Built kernels on disk, found by everything that went into them.

An entry is a shared library, named by its recipe and by its own content, and a manifest that
names the library. Both appear by renaming, the manifest last, so that processes may race and may
be killed at any time: a manifest always stands for a whole library, and a library that is not
what its manifest says is never loaded. A build holds a shared lock on the folder; the first process
that finds the folder free removes what killed builds have left. It also holds the lock of its
recipe, so that processes that miss the same kernel build it once. Both locks end with their owner.

The recipe is known once the equations are derived. So that a cached start need not derive them, an
index maps a quicker key, such as the sources' digest, to the recipe.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import re
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import platformdirs

from ..errors import CondyleError

try:
    import fcntl
except ImportError:  # not POSIX
    fcntl = None  # type: ignore[assignment]

STALE_SECONDS = 3600  # older than any build: cleared even where folders cannot be locked
PATIENCE = 300.0  # seconds that another's build of the same kernel is waited for
POLL_PERIOD = 0.02  # seconds
ROOM = 1 << 22  # bytes; no library is larger
BUILD = "condyle-build-"  # what such a folder's name begins with
# Files that are ours to remove.
ENTRY = re.compile(r"[0-9a-f]{40}(\.json|\.index|\.lock|-[0-9a-f]{16}\.so)")

Facts = dict[str, Any]
Make = Callable[[Path], tuple[Path, Facts]]
_apart: dict[str, CachedLibrary] = {}  # kernels of this process alone


class CacheError(CondyleError):
    """A cache that cannot be cleared."""


@dataclass(frozen=True)
class CachedLibrary:
    """A library that is safe to load, and what is known of it."""

    library: Path
    facts: Facts
    cached: bool


@dataclass(frozen=True)
class Contents:
    """What a cache holds.

    kernels: those that are whole.
    size:    of all that is there [bytes], also of what is broken or half built.
    """

    folder: Path
    kernels: int
    size: int


def cache_folder() -> Path:
    """Where kernels are kept: `CONDYLE_CACHE`, else the user's cache folder."""
    if chosen := os.environ.get("CONDYLE_CACHE"):
        return Path(os.path.expanduser(chosen)).absolute()
    return Path(platformdirs.user_cache_dir("condyle")) / "kernels"


def digest(*parts: str | bytes) -> str:
    """Name of a recipe: a hash of everything that matters, each part apart."""
    h = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        h.update(len(data).to_bytes(8, "little"))
        h.update(data)
    return h.hexdigest()[:40]


def find(recipe: str) -> CachedLibrary | None:
    """The kernel of a recipe, if it is there and whole."""
    if recipe in _apart:
        return _apart[recipe]
    folder = cache_folder()
    return _valid_entry(folder, recipe) if _trusted(folder) else None


def indexed(key: str) -> str | None:
    """The recipe that `key` stands for in the index, if it is known."""
    folder = cache_folder()
    if not _trusted(folder):
        return None
    try:
        recipe, seal = (folder / f"{key}.index").read_text(encoding="ascii").split()
    except (OSError, ValueError):
        return None
    return recipe if seal == digest(key, recipe) else None


def index(key: str, recipe: str) -> None:
    """Let `key` stand for the recipe from now on, where the folder can be written."""
    folder = cache_folder()
    if recipe in _apart or not _trusted(folder):
        return
    with suppress(OSError), _workplace(folder) as place:
        line = place / "index"
        line.write_text(f"{recipe} {digest(key, recipe)}", encoding="ascii")
        _place(line, folder / f"{key}.index")


def build(
    recipe: str, make: Make, say: Callable[[str, str], None], broken: CachedLibrary | None = None
) -> CachedLibrary:
    """Build a kernel and keep it, unless another process has meanwhile; where nothing can be kept,
    build it for this process alone.

    Args:   make: builds in an empty folder and returns the library and facts about it.
            say:  told when the cache cannot be used: what, and what that is about.
            broken: what the cache had, which cannot be loaded.
    Raises: OSError: if there is no place to build at all; what `make` raises.
    """
    folder = cache_folder()
    try:
        _prepare(folder)
        with _held(folder), _turn(folder / f"{recipe}.lock"), _workplace(folder) as place:
            entry = _valid_entry(folder, recipe)
            if entry is not None and entry != broken:
                return entry
            library, facts = make(place)
            facts["sha256"] = _hash(library)
            facts["library"] = f"{recipe}-{facts['sha256'][:16]}.so"
            manifest = place / "manifest.json"
            sealed = {"seal": _seal(recipe, facts), "facts": facts}
            manifest.write_text(json.dumps(sealed), encoding="utf-8")
            _place(library, folder / facts["library"])
            _place(manifest, folder / f"{recipe}.json")
        return CachedLibrary(folder / facts["library"], facts, False)
    except (OSError, CondyleError) as error:
        if isinstance(error, CondyleError) and _has_room(folder):
            raise  # not the disk's fault
        entry = build_apart(recipe, make)
        why = getattr(error, "strerror", None) or str(error).partition("\n")[0]
        say(
            f"the kernel cache {folder} cannot be used ({why}); kernels are built for this "
            "process alone. CONDYLE_CACHE names another folder",
            "cache",
        )
        return entry


def build_apart(recipe: str, make: Make) -> CachedLibrary:
    """Build a kernel for this process alone, in a temporary folder that goes when it ends."""
    place = Path(tempfile.mkdtemp(prefix="condyle-"))
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    try:
        library, facts = make(place)
    except BaseException:
        shutil.rmtree(place, ignore_errors=True)
        raise
    _apart[recipe] = CachedLibrary(library, facts, False)
    return _apart[recipe]


def contents() -> Contents:
    """How many kernels there are and what they take [bytes]."""
    folder = cache_folder()
    entries = _entries(folder)
    valid = [path for path in entries if path.suffix == ".json" and _valid_entry(folder, path.stem)]
    half_built = [
        Path(top, name)
        for place in folder.glob(f"{BUILD}*")
        for top, _, files in os.walk(place)  # which takes folders that go meanwhile
        for name in files
    ]
    size = 0
    for path in entries + half_built:
        with suppress(OSError):  # gone meanwhile
            size += path.stat().st_size
    return Contents(folder, len(valid), size)


def clear() -> Contents:
    """Remove every kernel and nothing else; returns what there was. Builds go on undisturbed.

    Raises: CacheError: if the folder cannot be written.
    """
    had = contents()
    if had.folder.is_dir():
        try:
            with _held(had.folder):
                for path in _entries(had.folder):
                    _remove(path)
        except OSError as error:
            raise CacheError(f"{had.folder} cannot be cleared: {error.strerror}") from None
    return had


def _place(source: Path, target: Path) -> None:
    """Rename a file to its place, where somebody may have put a folder.

    Whatever the umask, nobody else can write it: it would not be trusted.
    """
    source.chmod(0o600)
    try:
        os.replace(source, target)
    except IsADirectoryError:
        _remove(target)
        os.replace(source, target)
    except PermissionError:
        # Windows lets nobody replace a library that is loaded; one of that name is the same.
        if not target.is_file() or _hash(target) != _hash(source):
            raise


def _remove(path: Path) -> None:
    """Remove an entry, also one that is a folder."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _entries(folder: Path) -> list[Path]:
    return [path for path in folder.glob("*") if ENTRY.fullmatch(path.name)]


def _valid_entry(folder: Path, recipe: str) -> CachedLibrary | None:
    """The entry of a recipe, if its library is the one that its manifest was written for."""
    try:
        manifest = json.loads((folder / f"{recipe}.json").read_text(encoding="utf-8"))
        facts = manifest["facts"]
        library = folder / facts["library"]
        if not _owned(library.lstat()):
            return None
        if manifest["seal"] != _seal(recipe, facts) or _hash(library) != facts["sha256"]:
            return None
        return CachedLibrary(library, facts, True)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _seal(recipe: str, facts: Facts) -> str:
    return digest(recipe, json.dumps(facts, sort_keys=True))


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _prepare(folder: Path) -> None:
    """Make the folder.

    Raises: OSError: if there cannot be one that only we can write.
    """
    if not folder.is_absolute():
        raise FileNotFoundError(0, "there is no home folder")
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    if not _trusted(folder):
        raise PermissionError(0, "it belongs to or can be written by others")


def _trusted(folder: Path) -> bool:
    """Whether nobody else can put libraries there."""
    if not folder.is_absolute() or not folder.is_dir():
        return False
    try:
        about = folder.stat()
    except OSError:
        return False
    return _owned(about)


def _owned(about: os.stat_result) -> bool:
    """Whether a file or folder is this user's, and nobody else can write it."""
    if not hasattr(os, "getuid"):
        return True
    own = about.st_uid == os.getuid() and not stat.S_ISLNK(about.st_mode)
    return own and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _has_room(folder: Path) -> bool:
    """Whether a library as large as any would fit."""
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(ROOM))
        return True
    except OSError:
        return False


@contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Keep others from sweeping the folder; sweep it first if nobody holds it."""
    handle = os.open(folder, os.O_RDONLY) if fcntl else -1
    try:
        _sweep(folder, alone=_locked(handle, exclusive=True))
        _locked(handle, exclusive=False)
        yield
    finally:
        if fcntl:
            os.close(handle)


@contextmanager
def _workplace(folder: Path) -> Iterator[Path]:
    """A folder in the cache's own, so that what is made there can be renamed into place."""
    with tempfile.TemporaryDirectory(prefix=BUILD, dir=folder, ignore_cleanup_errors=True) as name:
        yield Path(name)


@contextmanager
def _turn(path: Path) -> Iterator[None]:
    """Hold the lock of a recipe, waiting while another builds it.

    The system takes the lock from an owner that is killed; one that hangs is waited for as long as
    a build may take.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o600) if fcntl else -1
    try:
        end = time.monotonic() + PATIENCE
        while fcntl and _busy(handle) and time.monotonic() < end:
            time.sleep(POLL_PERIOD)
        yield
    finally:
        if fcntl:
            path.unlink(missing_ok=True)
            os.close(handle)


def _busy(handle: int) -> bool:
    """Whether another process holds the lock of an open file; takes it otherwise."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        pass
    return False


def _locked(handle: int, exclusive: bool) -> bool:
    """Lock an open folder, for oneself at once or not at all; some file systems have no locks."""
    if fcntl is None:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB if exclusive else fcntl.LOCK_SH)
    except OSError:
        return False
    return True


def _sweep(folder: Path, alone: bool) -> None:
    """Remove what killed builds left behind.

    Args: alone: nobody else builds. Otherwise only what is too old to be in use goes.
    """
    for path in folder.glob(f"{BUILD}*"):
        with suppress(OSError):
            if alone or time.time() - path.stat().st_mtime > STALE_SECONDS:
                shutil.rmtree(path, ignore_errors=True)
    if alone:
        for path in _entries(folder):
            if path.suffix == ".lock" or (path.suffix == ".so" and not _named(path)):
                with suppress(OSError):
                    _remove(path)


def _named(library: Path) -> bool:
    """Whether a manifest stands for the library."""
    try:
        return library.name.encode() in library.with_name(f"{library.name[:40]}.json").read_bytes()
    except OSError:
        return False
