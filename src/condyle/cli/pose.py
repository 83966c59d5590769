"""condyle pose: forward kinematics."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command


@command(COMPUTE, example="condyle pose jaw.toml --joints encoders.csv --out poses.csv")
def pose(
    mechanism: options.Mechanism,
    joints: Path,
    out: Path,
    flag: bool = False,
    tolerance: float = 1e-6,
    every: bool = False,
    seed: int | None = None,
) -> Answer:
    """Where the platform is, from what encoders read.

    Every row of joint coordinates gives the pose X, Y, Z (m), alpha, beta, gamma (rad): forward
    kinematics.

    Options:
        joints: Joint coordinates (CSV or Parquet): joint_CHAIN for each chain (rad, or m for a
            slider), zero at home. With a column t (s) each row follows the one before, else each
            stands alone and follows from home.
        out: File for the poses (.csv or .parquet).
        tolerance: Largest difference of a joint of the pose from the given one (rad, or m).
        every: List the assembly modes that a search finds; it may miss some.
        seed: Of the search of --all. Default: 0.
    """
    import condyle

    from ..errors import UnsupportedError
    from ..results.pose_rows import ModesReport, PoseReport, modes_file, pose_file

    if every and flag:
        raise UnsupportedError("--all lists all poses of a row, be it none; leave out --flag")
    if seed is not None and not every:
        raise UnsupportedError("--seed is of the search of --all; add that, or leave --seed out")
    machine = condyle.load_mechanism(mechanism)
    report: ModesReport | PoseReport
    if every:
        report = modes_file(machine, joints, out, seed or 0, tolerance)
    else:
        report = pose_file(machine, joints, out, flag, tolerance)
    text = f"{report}\n{files_line([out])}"
    return Answer(text, asdict(report) | {"files": [out]}, command_line("view", mechanism))
