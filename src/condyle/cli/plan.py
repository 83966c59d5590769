"""condyle path: a motion from poses."""

from __future__ import annotations

from pathlib import Path

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import warn


@command(COMPUTE, example="condyle path robot.toml --study path.toml --out path.csv")
def path(mechanism: options.Mechanism, study: Path, out: Path) -> Answer:
    """A motion through poses: at rest in each of them, or one smooth cycle of chewing.

    Point to point within bounds of speed, acceleration and jerk. Says which share of each limit,
    efforts and speeds of the mechanism included, is used, and when.

    Options:
        study: Path study (TOML): poses, bounds or a period.
        out: Motion file (.csv or .parquet).
    """
    import condyle

    found = condyle.plan_path(mechanism, study)
    warn(found.warnings)
    found.save(out)
    data = {**found.data, "files": [str(out)]}
    then = command_line("run", mechanism, motion=out)
    return Answer(f"{found}\n{files_line([out])}", data, then)
