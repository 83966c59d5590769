"""condyle optimise: the cycle through poses that costs least."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .answer import Answer, command_line, files_line
from .command import COMPUTE, command


@command(COMPUTE, example="condyle optimise study.toml --out cycle.csv")
def optimise(
    study: Annotated[Path, typer.Argument(help="Study of an optimal motion (TOML).")],
    out: Path,
    start: Path | None = None,
) -> Answer:
    """The periodic motion through poses that costs least, within limits.

    Effort or activation of muscles, its peak, joint load, jerk, time, distance from a path; limits
    of efforts, loads, singularity and contacts' bounds, teeth on paths. Says what holds the motion
    back, and what the solver did.

    Options:
        out: Motion file of one period (.csv or .parquet).
        start: Motion file to begin the search from, such as an earlier result.
    """
    import condyle

    found = condyle.optimise(study, start=start)
    found.save(out)
    data = {**found.data, "files": [str(out)]}
    then = command_line("run", found.mechanism.name, motion=out)
    return Answer(f"{found}\n{files_line([out])}", data, then)
