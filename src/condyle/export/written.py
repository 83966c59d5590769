"""What every export begins and ends with: a model, a folder, and the files that were written."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..atomic import write_text
from ..errors import InputError
from ..mechanism import Mechanism, load_mechanism
from ..model.model import Model


class Written(list[Path]):
    """The files that an export wrote.

    notes: what is approximate or left out, a sentence each.
    data:  what else is known of the export, by name.
    """

    def __init__(
        self,
        files: Iterable[Path],
        notes: Iterable[str] = (),
        data: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(files)
        self.notes, self.data = list(dict.fromkeys(notes)), dict(data or {})


def mechanism_of(given: Model | Mechanism | str | os.PathLike[str]) -> Mechanism:
    """The mechanism of a model, a mechanism itself, or one by its file or name."""
    if isinstance(given, Model):
        return given.mechanism
    if isinstance(given, Mechanism):
        return given
    if isinstance(given, str | os.PathLike):
        return load_mechanism(os.fspath(given))
    raise InputError(
        "model: expected a model, a mechanism, its file, or the name of a bundled one, got "
        f"{type(given).__name__}"
    )


def folder_at(path: str | os.PathLike[str]) -> Path:
    """The folder for an export, made if need be.

    Raises: InputError: if it cannot be one.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"path: expected a path, got {type(path).__name__}")
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be made a folder for results ({reason})") from None
    return Path(path)


def file_at(path: str | os.PathLike[str], name: str, suffix: str) -> Path:
    """The path itself if it ends in `suffix`, else the file of that name in the folder."""
    if isinstance(path, str | os.PathLike) and str(path).endswith(suffix):
        folder_at(Path(path).parent)
        return Path(path)
    return folder_at(path) / f"{file_stem(name)}{suffix}"


def file_stem(name: str) -> str:
    """The name of a mechanism as the beginning of a file name: no way out of the folder."""
    return re.sub(r"[^\w.+-]+", "_", name)


def write_texts(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write files by name, each whole or not at all."""
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


def names_of(argument: str, given: str | Sequence[str]) -> tuple[str, ...]:
    """One name, several separated by commas, or a sequence of them.

    Raises: InputError: for anything else.
    """
    if isinstance(given, str):
        return tuple(part.strip() for part in given.split(","))
    if not isinstance(given, Sequence) or not all(isinstance(one, str) for one in given):
        raise InputError(f"{argument}: expected a name or several, got {given!r:.60}")
    return tuple(given)
