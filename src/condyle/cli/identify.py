"""condyle identify, excite, calibrate: numbers of a mechanism's file from the machine itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..errors import InputError
from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import require_drawing, warn


@command(
    COMPUTE,
    example="condyle identify robot.toml --log run.csv --study fit.toml --out fitted.toml",
)
def identify(
    mechanism: options.Mechanism,
    study: Path,
    out: Path,
    log: Annotated[list[Path] | None, options.option()] = None,
    report: Path | None = None,
) -> Answer:
    """Masses, mass centres, inertias and friction from logs of the machine.

    Weighted least squares of the equations of motion; numbers that the logs cannot tell stay as
    they are, and are named.

    Options:
        study: Fit study (TOML): the unknown numbers, what is known of them, the noise.
        out: Mechanism file with the fitted numbers, its comments kept.
        log: Log (CSV or Parquet), may be repeated: t, joint_CHAIN or coordinates such as X (m),
            tau_CHAIN (N m or N), if any Fx .. Mz and contact_CONTACT (N).
        report: Also write a page (.html) with residuals, numbers and correlations.
    """
    require_drawing(report is not None, False)
    import condyle

    if not log:
        raise InputError("expected --log with a file, once or more")
    found = condyle.identify(mechanism, log, study)
    warn(found.warnings)
    found.save(out)
    files = [out]
    if report is not None:
        found.write_report(report)
        files.append(report)
    text = f"{found}\n{files_line(files)}"
    data = {**found.data, "files": list(map(str, files))}
    return Answer(text, data, command_line("check", out))


@command(
    COMPUTE,
    example="condyle calibrate robot.toml --poses poses.csv --study calib.toml --out fitted.toml",
)
def calibrate(
    mechanism: options.Mechanism,
    poses: Path,
    study: Path,
    out: Path,
) -> Answer:
    """Points, axes and zeros of encoders from joints and measured poses.

    All rows are fitted at once, with the measuring frame and the target's; numbers that the rows
    cannot tell stay as they are, and are named.

    Options:
        poses: Table (CSV or Parquet), one pose per row: joint_CHAIN, and X, Y, Z (m), alpha, beta,
            gamma (rad) of a target, or NAME_x, NAME_y, NAME_z (m) of points on the platform, or t
            (s) where the study names a recording of markers (C3D, TRC, CSV or Parquet).
        study: Calibration study (TOML): the unknown numbers, their tolerances, the noise.
        out: Mechanism file with the fitted numbers, its comments kept.
    """
    import condyle

    found = condyle.calibrate(mechanism, poses, study)
    warn(found.warnings)
    found.save(out)
    data = {**found.data, "files": [str(out)]}
    return Answer(f"{found}\n{files_line([out])}", data, command_line("check", out))


@command(COMPUTE, example="condyle excite robot.toml --study excite.toml --out path.csv")
def excite(
    mechanism: options.Mechanism,
    out: Path,
    study: Path | None = None,
) -> Answer:
    """The periodic path that tells most about masses, inertias and friction.

    Within reach, bounds of contacts, limits of speed and effort, and away from singularities. Says
    how well one period tells each number, and how many reach what is wanted.

    Options:
        out: Motion file for one period (.csv or .parquet).
        study: Excitation study (TOML): numbers, noise, period, limits. Default: the platform's
            numbers, and friction of the actuators.
    """
    import condyle

    found = condyle.excite(mechanism, study)
    found.save(out)
    data = {**found.data, "files": [str(out)]}
    then = command_line("run", mechanism, motion=out)
    return Answer(f"{found}\n{files_line([out])}", data, then)
