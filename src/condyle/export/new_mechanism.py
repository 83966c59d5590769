"""A mechanism file to start from."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, WarningError, as_flag, as_name, as_path, printable, shortened
from ..files.atomic import names_device, write_text
from ..mechanism import dumps, parse
from ..mechanism.library import (
    bundled_machine,
    bundled_mechanisms,
    bundled_text,
    copied_text,
    first_sentence,
    starter_text,
)
from ..mechanism.quantities import NAME_CHARACTERS

if TYPE_CHECKING:
    from .mjcf_import import ImportResult


@dataclass(frozen=True)
class NewMechanism:
    """A mechanism file that was written, and what a converted model lost."""

    path: Path
    warnings: tuple[str, ...] = ()


def new_mechanism(
    name: str,
    *,
    from_bundled: str | None = None,
    from_mjcf: str | os.PathLike[str] | None = None,
    force: bool = False,
    strict: bool = False,
) -> NewMechanism:
    """Write a small valid mechanism, with a comment on every number.

    Args:   name: of the mechanism; the file is NAME.toml.
            from_bundled: copy the commented file of this bundled mechanism, by its name or a word
            of it, instead; or make a jaw of the muscles of an OpenSim model (a path ending in
            .osim), or of a table of muscle points (.csv).
            from_mjcf: a MuJoCo model to convert instead.
            force: replace an existing file;  strict: a warning is an error.
    Raises: InputError: for an invalid name, a file that exists, or two sources at once.
    """
    if from_bundled is not None and from_mjcf is not None:
        raise InputError("from_bundled and from_mjcf each name a source; give one of them")
    name = as_path(name, "name", "a name")
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    stem = path.name.removesuffix(".toml")
    text, warnings = starter_text(stem), tuple[str, ...]()
    try:
        if stem.startswith(".") or names_device(stem):
            raise InputError("a hidden file, or none on Windows")
        parse(text)
    except InputError:
        raise InputError(
            f'"{shortened(stem, 80)}" cannot be the name of a mechanism; use at most '
            f"{NAME_CHARACTERS} letters, digits, - and _, and no device of Windows (con, nul, com1)"
        ) from None
    require_free(path, force)
    if from_mjcf is not None:
        from .mjcf_import import from_mjcf as of_mujoco

        model = Path(as_path(from_mjcf, "from_mjcf"))
        text, warnings = _converted(f"MuJoCo model {model.name}", of_mujoco(model, stem))
    elif from_bundled is not None and str(from_bundled).endswith(".osim"):
        from .osim_import import from_osim

        model = Path(as_path(from_bundled, "from_bundled"))
        text, warnings = _converted(f"OpenSim model {model.name}", from_osim(model, stem))
    elif from_bundled is not None and str(from_bundled).endswith(".csv"):
        from .points_import import from_points

        model = Path(as_path(from_bundled, "from_bundled"))
        text, warnings = _converted(f"table {model.name}", from_points(model, stem))
    elif from_bundled is not None:
        text = copied_text(bundled_machine(as_name(from_bundled, "from_bundled")), stem)
    if as_flag(strict, "strict") and warnings:
        raise WarningError(warnings)
    write_text(path, text)
    return NewMechanism(path, warnings)


def _converted(source: str, found: ImportResult) -> tuple[str, tuple[str, ...]]:
    """The file of a converted model, and what it lost."""
    source = printable(source, lines=False)
    head = [f"From the {source}. {{S}} is at the platform's mass centre at home.", *found.notes]
    return "\n".join([*(f"# {line}" for line in head), "", dumps(found.mechanism)]), found.notes


def require_free(path: Path, force: bool) -> None:
    """Raises InputError for a file that exists, unless it is to be replaced."""
    if path.exists() and not as_flag(force, "force"):
        raise InputError(f"{path} exists already; choose another name or add --force (force=True)")


def mechanism_lines() -> dict[str, str]:
    """What each bundled mechanism is, a line each."""
    return {name: first_sentence(bundled_text(name)) for name in bundled_mechanisms()}
