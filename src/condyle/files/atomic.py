"""Files that appear whole or not at all, and folders for them."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import socket
import time
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import InputError, as_path
from .reading import READ

_PART = re.compile(r"\..*\.([0-9a-f]{8})-(\d+)-[0-9a-f]{8}\.part", re.DOTALL)
_DEVICE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
TABLES = (".csv", ".parquet", "")  # endings; without one it is CSV
LOGS = (*TABLES, ".mcap")
_FORGOTTEN = 86400.0  # s without a change, after which a temporary file belongs to nobody


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Lend a temporary path in the folder of `path`; rename it to `path` when the block succeeds.

    On any exception the temporary file is removed and what stood at `path` is untouched. A link
    is followed, permissions stay; a device or pipe cannot be renamed to, so that one is lent
    itself.

    Raises: InputError: if `path` cannot be written, a full disk inside the block included.
    """
    target = check_writable(path)
    direct = os.path.exists(target) and not os.path.isfile(target)
    temporary = target if direct else _temporary_path(target)
    if not direct:
        _sweep(target.parent)
    try:
        try:
            yield temporary
            if not direct:
                with suppress(FileNotFoundError):
                    shutil.copymode(target, temporary)
                os.replace(temporary, target)
        finally:
            if not direct:
                temporary.unlink(missing_ok=True)
    except OSError as error:
        if error.filename is not None and str(error.filename) != str(temporary):
            raise  # another file's trouble
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error


def make_folder(path: str | os.PathLike[str]) -> Path:
    """A folder, and those above it, made unless they are there.

    Raises: InputError: if it cannot be one.
    """
    as_path(path, expected="a folder")
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be made a folder for results ({reason})") from None
    return Path(path)


def file_stem(name: str) -> str:
    """The name of a mechanism as the beginning of a file name: no way out of its folder."""
    stem = re.sub(r"[^\w.+-]+", "_", name)
    return f"_{stem}" if names_device(stem) else stem


def names_device(stem: str) -> bool:
    """Whether Windows has a device where a file of that name would be."""
    return _DEVICE.match(stem) is not None


def _temporary_path(target: Path) -> Path:
    """A name in the same folder that tells whose it is."""
    name = f".{target.name[:100]}.{_host()}-{os.getpid()}-{secrets.token_hex(4)}.part"
    return target.with_name(name)


def _sweep(folder: Path) -> None:
    """Remove what killed processes left in a folder.

    What is of this machine goes when its process is gone. Of another machine, or where the number
    of the process was given anew, nobody can tell; those go after a day without a change.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if not (left := _PART.fullmatch(entry.name)):
                continue
            with suppress(OSError):
                gone = left[1] == _host() and not _lives(int(left[2]))
                if gone or time.time() - entry.stat().st_mtime > _FORGOTTEN:
                    os.unlink(entry.path)


def _host() -> str:
    return f"{zlib.crc32(socket.gethostname().encode()):08x}"


def _lives(process: int) -> bool:
    if os.name != "posix":
        return True  # there, asking would end it
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # it is somebody else's
        pass
    return True


def check_writable(path: str | os.PathLike[str], endings: Iterable[str] = ()) -> Path:
    """The file or device that is written to, links followed.

    Raises: InputError: if it is a folder, or stands in none, or is a file of none of `endings`; or
            if the command that runs has read it.
    """
    path = as_path(path)
    if os.path.isdir(path):
        raise InputError(f"{path}: is a folder; give the name of a file to write")
    if os.path.exists(path) and not os.path.isfile(path):
        return Path(path)
    if endings:
        ending_of(path, endings)
    target = Path(os.path.realpath(path))
    if str(target) in (READ.get() or ()):
        raise InputError(f"{path}: would replace what this command reads; write to another place")
    if not os.path.isdir(target.parent):
        raise InputError(f"{path}: the folder {target.parent} does not exist; create it first")
    return target


def ending_of(path: str | os.PathLike[str], endings: Iterable[str]) -> str:
    """The ending of a file's name, in small letters, such as ".csv".

    Raises: InputError: if it is none of `endings`.
    """
    ending = Path(as_path(path)).suffix.lower()
    if ending not in endings:
        *others, last = filter(None, endings)
        expected = f"{', '.join(others)} or {last}" if others else last
        raise InputError(f"{path}: expected a name that ends in {expected}")
    return ending


def for_parquet(path: str | os.PathLike[str]) -> bool:
    """Whether a table that is written there is a Parquet file, else CSV.

    Raises: InputError: if the name is that of another kind of file, or nothing can be written.
    """
    check_writable(path, TABLES)
    return Path(path).suffix.lower() == ".parquet"


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
