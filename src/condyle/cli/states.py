"""condyle solve, forward, pose: independent states, one per row of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import STRICT, model_of, warn


@command(COMPUTE, example="condyle solve jaw.toml --states states.csv --out efforts.csv")
def solve(
    mechanism: options.Mechanism,
    states: Path,
    out: Path,
    model: options.ModelOptions,
    distribution: options.DistributionOptions,
    load_point: options.LoadPoint = None,
    reactions: options.Reactions = False,
    mat: options.Mat = False,
    flag: options.Flag = False,
    max_error: options.MaxError = None,
    noise: str | None = None,
) -> Answer:
    """Inverse dynamics of independent states, one per row.

    For tables of any length: rows never influence each other.

    Options:
        states: States (CSV or Parquet), one per row: pose coordinates such as X, Y (m), alpha, beta
            (rad), their rates dX ... (per s) and accelerations ddX ... (per s^2; at rest without
            both), and, if any, Fx, Fy, Fz (N), Mx, My, Mz (N m), gravity gx, gy, gz (m/s^2) and the
            base's motion base_ax ... base_dwz.
        out: File for the results (.csv or .parquet).
        noise: Standard deviations of columns of states, "X=0.01 mm,dX=1 mm/s", and of numbers of
            the mechanism file (SI), "platform.mass=0.01": those of the efforts are written too, as
            sd_tau_CHAIN.
    """
    import condyle

    solved = condyle.solve_states(
        model_of(mechanism, model, distribution),
        states,
        out,
        load_point=load_point,
        flag=flag,
        strict=STRICT.get(),
        reactions=reactions,
        threads=model.threads,
        mat=out.with_suffix(".mat") if mat else None,
        max_error=max_error,
        noise=noise,
    )
    warn(solved.data["warnings"])
    return Answer(str(solved), solved.data, command_line("view", mechanism))


@command(COMPUTE, example="condyle forward jaw.toml --states states.csv --out accelerations.csv")
def forward(
    mechanism: options.Mechanism,
    states: Path,
    out: Path,
    model: options.ModelOptions,
    load_point: options.LoadPoint = None,
    flag: options.Flag = False,
    max_error: options.MaxError = None,
) -> Answer:
    """Forward dynamics of independent states, one per row.

    Accelerations and contact forces under given efforts and a load. Rows never influence each
    other.

    Options:
        states: States and efforts (CSV or Parquet), one per row: pose coordinates such as X, Y (m),
            alpha, beta (rad), their rates dX ... (per s), tau_CHAIN of every chain (N m, or N where
            it slides or pulls), and, if any, Fx, Fy, Fz (N), Mx, My, Mz (N m), gravity gx, gy, gz
            (m/s^2) and the base's motion base_ax ... base_dwz.
        out: File for the results (.csv or .parquet).
    """
    import condyle

    solved = condyle.forward_states(
        model_of(mechanism, model),
        states,
        out,
        load_point=load_point,
        flag=flag,
        strict=STRICT.get(),
        threads=model.threads,
        max_error=max_error,
    )
    warn(solved.data["warnings"])
    return Answer(str(solved), solved.data, command_line("view", mechanism))


@command(
    COMPUTE,
    example="condyle derivatives jaw.toml --states states.csv --wrt platform.mass --out slopes.csv",
)
def derivatives(
    mechanism: options.Mechanism,
    states: Path,
    out: Path,
    model: options.ModelOptions,
    distribution: options.DistributionOptions,
    of: Annotated[list[str] | None, options.option()] = None,
    wrt: Annotated[list[str] | None, options.option()] = None,
    load_point: options.LoadPoint = None,
    flag: options.Flag = False,
    zeros: bool = False,
) -> Answer:
    """Exact derivatives at independent states, one per row, in SI units.

    Columns are called "d tau_CHAIN / d X", "d tau_CHAIN / d platform.mass" and so on.

    Options:
        states: States (CSV or Parquet), one per row, as condyle solve reads them; for acceleration
            as condyle forward does.
        out: File for the derivatives (.csv or .parquet).
        of: effort, contact_force, acceleration, pose, joint, contact_point or singularity_ratio;
            several times for several. Default: effort.
        wrt: q, v, a, wrench, at, effort, gravity, base, or the path of a number of the
            mechanism file such as platform.mass; several times for several. Default: q.
        zeros: Write zeros where a number cannot matter, instead of failing.
    """
    import condyle

    report = condyle.derivative_states(
        model_of(mechanism, model, distribution),
        states,
        out,
        of or ["effort"],
        wrt or ["q"],
        load_point=load_point,
        flag=flag,
        zeros=zeros,
        strict=STRICT.get(),
    )
    warn(report.data["warnings"])
    return Answer(str(report), report.data, command_line("view", mechanism))


@command(COMPUTE, example="condyle pose jaw.toml --joints encoders.csv --out poses.csv")
def pose(
    mechanism: options.Mechanism,
    joints: Path,
    out: Path,
    flag: options.Flag = False,
    max_error: options.MaxError = None,
    tolerance: Annotated[float, options.option(min=0.0)] = 1e-6,
    every: Annotated[bool, options.option("", "--all")] = False,
    seed: Annotated[int | None, options.option(min=0)] = None,
) -> Answer:
    """Pose of the platform from encoder readings (forward kinematics), one per row.

    Readings in, pose X, Y, Z (m), alpha, beta, gamma (rad) out.

    Options:
        joints: Encoder readings (CSV or Parquet): joint_CHAIN for each chain (rad, or m for a
            slider), its joint coordinate plus its actuator's zero. With a column t (s) each row
            starts from the row before, otherwise each starts from home.
        out: File for the poses (.csv or .parquet).
        tolerance: Largest difference between a joint coordinate of the pose and the given one (rad,
            or m).
        every: List all assembly modes that a random search finds; it may miss some.
        seed: Seed of the search of --all. Default: 0.
    """
    import condyle

    report = condyle.pose_states(mechanism, joints, out, flag, tolerance, every, seed, max_error)
    text = f"{report}\n{files_line(report.data['files'])}"
    return Answer(text, report.data, command_line("view", mechanism))
