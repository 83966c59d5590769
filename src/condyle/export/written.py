"""What every export begins and ends with: a model, a folder, and the files that were written."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..files.atomic import file_stem, make_folder, write_text


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
        self.notes: list[str] = list(dict.fromkeys(notes))
        self.data: dict[str, Any] = dict(data or {})


def file_at(path: str | os.PathLike[str], name: str, suffix: str) -> Path:
    """The path itself if it ends in `suffix`, else the file of that name in the folder."""
    if isinstance(path, str | os.PathLike) and str(path).endswith(suffix):
        make_folder(Path(path).parent)
        return Path(path)
    return make_folder(path) / f"{file_stem(name)}{suffix}"


def write_texts(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write files by name, each whole or not at all."""
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]
