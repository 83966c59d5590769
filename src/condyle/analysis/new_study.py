"""A study file to start from: one commented text a kind, in `studies`, or made from its tables."""

from __future__ import annotations

import os
from importlib.resources import files
from inspect import getdoc
from pathlib import Path

from ..errors import InputError, as_path
from ..export.new_mechanism import require_free
from ..files.atomic import names_device, write_text
from ..mechanism.library import first_sentence
from ..mechanism.quantities import NAME_CHARACTERS
from ..mechanism.table_schema import schema_of
from .studies import StudyName, studies, study_kind

_STUDIES = files(__package__) / "study_templates"


def study_lines() -> dict[str, str]:
    """What each kind of study file is for, a line each."""
    return {
        kind: first_sentence(template(kind)).removeprefix("NAME: ") for kind in sorted(studies())
    }


def template(kind: str) -> str:
    """The commented text of a kind, of a study called NAME.

    Raises: InputError: for an unknown kind.
    """
    import tomli_w

    tables, text = study_kind(kind).file, _STUDIES / f"{kind}.toml"
    if text.is_file():
        return text.read_text(encoding="utf-8")
    parts = [f"# NAME: {(getdoc(tables) or kind).splitlines()[0]}\n"]
    for key, entry in schema_of(tables)["properties"].items():
        value = entry.get("default", next(iter(entry.get("examples", [])), None))
        said = f"# {entry['description']}\n" if "description" in entry else ""
        parts.append(said + (f"# {key} =\n" if value is None else tomli_w.dumps({key: value})))
    return "\n".join(parts)


def new_study(name: str | os.PathLike[str], kind: StudyName, *, force: bool = False) -> Path:
    """Write a study file with a comment on every key; returns its path.

    Args:   name: the file is NAME.toml;  kind: of `study_lines`;  force: replace an existing file.
    Raises: InputError: for an unknown kind, an invalid name, or a file that exists.
    """
    written = template(kind)
    text = as_path(name, "name", "a name")
    path = Path(text if text.endswith(".toml") else f"{text}.toml")
    stem = path.name.removesuffix(".toml")
    wrong = not stem.strip(".") or not stem.isprintable() or len(stem) > NAME_CHARACTERS
    if wrong or names_device(stem):
        raise InputError(
            f"name: expected at most {NAME_CHARACTERS} letters, digits, - and _ for a file, and no "
            "device of Windows (con, nul, com1)"
        )
    require_free(path, force)
    write_text(path, written.replace("NAME", stem))
    return path
