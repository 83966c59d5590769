"""condyle pose: forward kinematics."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import options
from .app import MAIN, app
from .inputs import say


@app.command(rich_help_panel=MAIN)
def pose(
    mechanism: options.Mechanism,
    joints: Annotated[Path, typer.Option(help="Joint coordinates (CSV): joint_<chain> ...")],
    out: Annotated[Path, typer.Option(help="File for the poses (CSV).")],
    flag: options.Flag = False,
    quiet: options.Quiet = False,
) -> None:
    """Poses from joint coordinates, as encoders give them (forward kinematics)."""
    import condyle

    from ..joints import pose_file

    report = pose_file(condyle.load(mechanism), joints, out, flag)
    say(quiet, f"{report}\nResults: {out}")
