"""condyle new: a first mechanism file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .answer import Answer, command_line
from .command import START, command
from .inputs import STRICT, warn


@command(START, example="condyle new my-robot")
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
    import condyle

    made = condyle.new_mechanism(name, from_mjcf=from_mjcf, force=force, strict=STRICT.get())
    warn(made.warnings)
    return Answer(f"Wrote {made.path}", {"files": [made.path]}, command_line("check", made.path))
