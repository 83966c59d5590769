"""A study file to start from: one commented text a kind, in `studies`."""

from __future__ import annotations

import os
from importlib.resources import files
from pathlib import Path

from ..atomic import write_text
from ..errors import InputError, as_flag, as_name, as_path, did_you_mean
from ..mechanism.library import first_sentence
from ..mechanism.quantities import NAME_CHARACTERS

_STUDIES = files(__package__) / "studies"


def study_kinds() -> tuple[str, ...]:
    """Kinds of study files that `new_study` writes."""
    return tuple(sorted(f.name[:-5] for f in _STUDIES.iterdir() if f.name.endswith(".toml")))


def study_lines() -> dict[str, str]:
    """What each kind of study file is for, a line each."""
    texts = {
        kind: (_STUDIES / f"{kind}.toml").read_text(encoding="utf-8") for kind in study_kinds()
    }
    return {kind: first_sentence(text).removeprefix("NAME: ") for kind, text in texts.items()}


def new_study(name: str | os.PathLike[str], kind: str, *, force: bool = False) -> Path:
    """Write a study file with a comment on every key; returns its path.

    Args:   name: the file is NAME.toml;  kind: of `study_kinds`;  force: replace an existing file.
    Raises: InputError: for an unknown kind, an invalid name, or a file that exists.
    """
    if as_name(kind, "kind") not in (known := study_kinds()):
        raise InputError(f'kind: no study file is called "{kind}".{did_you_mean(kind, known)}')
    text = as_path(name, "name", "a name")
    path = Path(text if text.endswith(".toml") else f"{text}.toml")
    stem = path.name.removesuffix(".toml")
    if not stem.strip(".") or not stem.isprintable() or len(stem) > NAME_CHARACTERS:
        raise InputError(
            f"name: expected at most {NAME_CHARACTERS} letters, digits, - and _ for a file"
        )
    if path.exists() and not as_flag(force, "force"):
        raise InputError(f"{path} exists already; choose another name or add --force (force=True)")
    write_text(path, (_STUDIES / f"{kind}.toml").read_text(encoding="utf-8").replace("NAME", stem))
    return path
