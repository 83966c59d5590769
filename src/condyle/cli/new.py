"""condyle new: a first mechanism or study file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import UnsupportedError
from .answer import Answer, command_line
from .command import START, command
from .completion import STUDIES, one_of
from .inputs import STRICT, warn


@command(START, example="condyle new my-robot")
def new(
    name: Annotated[
        str, typer.Argument(help="Name of the mechanism or study; the file is NAME.toml.")
    ],
    from_mjcf: Path | None = None,
    study: Annotated[str | None, typer.Option(autocompletion=one_of(*STUDIES))] = None,
    force: bool = False,
) -> Answer:
    """Mechanism file to start from, or study file.

    A small mechanism that works, with a comment on every number, to change step by step; or, with
    --from-mjcf, a MuJoCo model; or, with --study, a commented file of that kind.

    Options:
        from_mjcf: Convert this MuJoCo model (MJCF), if a mechanism file has its kinds of chains and
            contacts.
        study: Write a study file of this kind instead: session.
        force: Replace an existing file.
    """
    import condyle

    if study is not None:
        if from_mjcf is not None:
            raise UnsupportedError("--study writes a study file, --from-mjcf a mechanism; take one")
        path = condyle.new_study(name, study, force=force)
        return Answer(f"Wrote {path}", {"files": [path]}, command_line("schema", study))

    made = condyle.new_mechanism(name, from_mjcf=from_mjcf, force=force, strict=STRICT.get())
    warn(made.warnings)
    return Answer(f"Wrote {made.path}", {"files": [made.path]}, command_line("check", made.path))
