"""condyle session: recordings of a laboratory, from one file to one report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .answer import Answer, command_line, files_line
from .command import START, command
from .inputs import STRICT, can_be_folder, require_drawing, warn


@command(START, example="condyle session session.toml --out results")
def session(
    session: Annotated[Path, typer.Argument(help="Session file (TOML).")],
    out: Path | None = None,
) -> Answer:
    """Motions, joint loads and chewing cycles from a session of recordings.

    Puts every trial on the mechanism by the session's markers, solves it, finds cycles, and writes
    a solution for each trial, a table of cycles, their mean and deviation, and one report.

    Options:
        out: Folder for the results. Default: the name of the session file.
    """
    require_drawing(True, True)
    import condyle

    folder = out or Path(session.stem)
    can_be_folder(folder)
    found = condyle.measure_session(session, folder, strict=STRICT.get())
    warn(found.warnings)
    then = command_line("view", solution=found.files[0])
    return Answer(f"{found}\n{files_line(found.files)}", found.data | {"files": found.files}, then)
