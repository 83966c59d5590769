"""condyle path: a motion from poses."""

from __future__ import annotations

from pathlib import Path

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import warn


@command(COMPUTE, example="condyle path robot.toml --study path.toml --out path.csv")
def path(mechanism: options.Mechanism, study: Path, out: Path) -> Answer:
    """A motion through poses, or the fastest along a path.

    At rest in each pose within bounds of speed, acceleration and jerk; or one smooth cycle of
    chewing; or a given path in the least time that limits of efforts, speeds and contacts permit,
    with what binds when. Says which share of each limit is used.

    Options:
        study: Path study (TOML): poses, bounds or a period; or a path to traverse.
        out: Motion file (.csv or .parquet).
    """
    import condyle

    found = condyle.plan_path(mechanism, study)
    warn(found.warnings)
    found.save(out)
    data = {**found.data, "files": [str(out)]}
    then = command_line("run", mechanism, motion=out)
    return Answer(f"{found}\n{files_line([out])}", data, then)
