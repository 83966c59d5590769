"""condyle pose: forward kinematics of joint coordinates, one state per row."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command


@command(COMPUTE, example="condyle pose jaw.toml --joints encoders.csv --out poses.csv")
def pose(
    mechanism: options.Mechanism,
    joints: Path,
    out: Path,
    flag: options.Flag = False,
    tolerance: Annotated[float, options.option(min=0.0)] = 1e-6,
    every: Annotated[bool, options.option("", "--all")] = False,
    seed: Annotated[int | None, options.option(min=0)] = None,
) -> Answer:
    """Pose of the platform from encoder readings (forward kinematics), one per row.

    Joint coordinates in, pose X, Y, Z (m), alpha, beta, gamma (rad) out.

    Options:
        joints: Joint coordinates (CSV or Parquet): joint_CHAIN for each chain (rad, or m for a
            slider), zero at home. With a column t (s) each row starts from the row before,
            otherwise each starts from home.
        out: File for the poses (.csv or .parquet).
        tolerance: Largest difference between a joint coordinate of the pose and the given one (rad,
            or m).
        every: List all assembly modes that a random search finds; it may miss some.
        seed: Seed of the search of --all. Default: 0.
    """
    import condyle

    report = condyle.pose_states(mechanism, joints, out, flag, tolerance, every, seed)
    text = f"{report}\n{files_line(report.data['files'])}"
    return Answer(text, report.data, command_line("view", mechanism))
