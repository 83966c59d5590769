"""condyle export mjcf: a mechanism for MuJoCo."""

from __future__ import annotations

from pathlib import Path

from . import options
from .answer import Answer, command_line
from .command import COMPUTE, command
from .export import export
from .inputs import warn


@command(COMPUTE, example="condyle export mjcf masticatory --out mujoco", of=export, name="mjcf")
def mjcf(
    mechanism: options.Mechanism,
    out: Path,
) -> Answer:
    """A model for MuJoCo (MJCF): loops, contacts, actuators with limits and losses, sensors.

    Controls are efforts in N m or N, joints are zero at home. Approximations are listed on stderr
    and in the file.

    Options:
        out: Folder for the file.
    """
    import condyle

    made = condyle.export_mjcf(mechanism, out)
    warn(made.notes)
    data = made.data | {"files": list(made)}
    return Answer(f"Wrote {made[0]}", data, command_line("check", mechanism))
