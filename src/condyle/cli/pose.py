"""condyle pose: forward kinematics."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command


@command(COMPUTE, example="condyle pose jaw.toml --joints encoders.csv --out poses.csv")
def pose(
    mechanism: options.Mechanism,
    joints: Annotated[
        Path,
        typer.Option(
            help="Joint coordinates (CSV): joint_CHAIN for each chain (rad, or m for a slider), "
            "zero at home, and t (s) if you like."
        ),
    ],
    out: Annotated[Path, typer.Option(help="File for the poses (CSV).")],
    flag: options.Flag = False,
) -> Answer:
    """Where the platform is, from what encoders read.

    Every row of joint coordinates gives the pose X, Y, Z (m), alpha, beta, gamma (rad): forward
    kinematics.
    """
    import condyle

    from ..results.poses import pose_file

    report = pose_file(condyle.load(mechanism), joints, out, flag)
    text = f"{report}\n{files_line([out])}"
    return Answer(text, asdict(report) | {"files": [out]}, command_line("view", mechanism))
