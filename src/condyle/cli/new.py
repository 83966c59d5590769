"""condyle new: a first mechanism file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError, shortened
from .answer import Answer, command_line
from .command import BEGIN, command
from .inputs import warn


@command(BEGIN, example="condyle new my-robot")
def new(
    name: Annotated[str, typer.Argument(help="Name of the mechanism; the file is NAME.toml.")],
    from_mjcf: Path | None = None,
    force: bool = False,
) -> Answer:
    """Mechanism file to start from.

    A small mechanism that works, with a comment on every number, to change step by step; or, with
    --from-mjcf, a MuJoCo model.

    Options:
        from_mjcf: Convert this MuJoCo model (MJCF), if a mechanism file has its kinds of chains and
            contacts.
        force: Replace an existing file.
    """
    from ..atomic import write_text
    from ..mechanism import parse
    from ..mechanism.library import starter_text
    from ..mechanism.quantities import NAME_CHARACTERS

    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    stem = path.name.removesuffix(".toml")
    text = starter_text(stem)
    try:
        if stem.startswith("."):
            raise InputError("a hidden file")
        parse(text)
    except InputError:
        raise InputError(
            f'"{shortened(stem, 80)}" cannot be the name of a mechanism; use at most '
            f"{NAME_CHARACTERS} letters, digits, - and _"
        ) from None
    if path.exists() and not force:
        raise InputError(f"{path} exists already; choose another name or add --force")
    if from_mjcf is not None:
        text = _imported(from_mjcf, stem)
    write_text(path, text)
    return Answer(f"Wrote {path}", {"files": [path]}, command_line("check", path))


def _imported(source: Path, name: str) -> str:
    """The file of what stands in a model of MuJoCo, its first lines saying what it has not."""
    from ..export.mjcf_import import from_mjcf
    from ..mechanism import dumps

    found = from_mjcf(source, name)
    warn(list(found.notes))
    told = [f"Of {source.name}, a model of MuJoCo. {{S}} is at the platform's mass centre at home."]
    lines = [f"# {line}" for line in (*told, *found.notes)]
    return "\n".join([*lines, "", dumps(found.mechanism)])
