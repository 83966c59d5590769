"""Dynamics of a motion, and of independent states, one per row of a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import condyle

from .answer import STRICT, Answer, answer, command_line, files_line, warn
from .command import to_compute
from .inputs import look_at, require_drawing, written
from .options import DistributionOptions, ModelOptions, MotionOptions, OutputOptions


@to_compute(
    "run jaw.toml --motion path.csv --units mm,deg --load bite.csv --report",
    "analysis.run_motion:run",
)
def run(
    mechanism: str = "masticatory",
    *,
    motion: MotionOptions,
    model: ModelOptions,
    distribution: DistributionOptions,
    output: OutputOptions,
    **given: Any,
) -> Answer:
    """Efforts and contact forces along a motion (inverse dynamics).

    Without arguments: the bundled chewing robot, a synthetic chewing path and bite force.

    Args:
        prove: Number of samples whose digits are proven by interval arithmetic (takes mpmath).
        vary: Study (TOML) whose numbers vary: also quantiles of efforts and contact forces.
    """
    require_drawing(output.figures, output.report)
    from ..results.proof import Proof
    from ..results.summary import summarize

    how = {**motion.arguments(), **model.arguments(), **given}
    solution = condyle.run(mechanism, distribution=distribution.chosen(), **how)
    warn(solution.condyle.warnings)
    inputs = (motion.motion, motion.load, given.get("measured"), given.get("vary"), mechanism)
    files = written(solution, output, inputs)
    summary = summarize(solution)
    proofs = json.loads(solution.attrs.get("proof", "[]"))
    lines = [str(summary), *(str(Proof(**one)) for one in proofs), "", files_line(files)]
    data = summary.data | ({"proof": proofs} if proofs else {}) | {"files": files}
    return Answer("\n".join(lines), data, look_at(files, output))


@to_compute(
    "solve jaw.toml --states states.csv --out efforts.csv",
    "results.inverse_rows:solve_states",
    without="strict",
)
def solve(
    mechanism: str,
    *,
    states: Path,
    out: Path,
    model: ModelOptions,
    distribution: DistributionOptions,
    mat: bool = False,
    **given: Any,
) -> Answer:
    """Args:
    states: States (CSV or Parquet), one per row: pose coordinates such as X, Y (m), alpha, beta
        (rad), their rates dX ... (per s) and accelerations ddX ... (per s^2; at rest without
        both), and, if any, Fx, Fy, Fz (N), Mx, My, Mz (N m), gravity gx, gy, gz (m/s^2) and the
        base's motion base_ax ... base_dwz.
    out: File for the results (.csv or .parquet).
    """
    given |= {"threads": model.threads, "mat": out.with_suffix(".mat") if mat else None}
    asked = model.of(mechanism, distribution)
    report = condyle.solve_states(asked, states, out, strict=STRICT.get(), **given)
    return answer(report, command_line("view", mechanism))


@to_compute(
    "forward jaw.toml --states states.csv --out accelerations.csv",
    "results.forward_rows:forward_states",
    without="strict",
)
def forward(
    mechanism: str, *, states: Path, out: Path, model: ModelOptions, **given: Any
) -> Answer:
    """Args:
    states: States and efforts (CSV or Parquet), one per row: columns of condyle solve without
        accelerations, and tau_CHAIN of every chain (N m, or N where it slides or pulls).
    out: File for the results (.csv or .parquet).
    """
    given |= {"threads": model.threads, "strict": STRICT.get()}
    report = condyle.forward_states(model.of(mechanism), states, out, **given)
    return answer(report, command_line("view", mechanism))


@to_compute(
    "derivatives jaw.toml --states states.csv --wrt platform.mass --out slopes.csv",
    "results.derivative_rows:derivative_states",
    without="strict",
)
def derivatives(
    mechanism: str,
    *,
    states: Path,
    out: Path,
    model: ModelOptions,
    distribution: DistributionOptions,
    **given: Any,
) -> Answer:
    """Exact derivatives at independent states, one per row, in SI units.

    Columns are called "d tau_CHAIN / d X", "d tau_CHAIN / d platform.mass" and so on.

    Args:
        states: States (CSV or Parquet), one per row, as condyle solve reads them; for acceleration
            as condyle forward does.
        out: File for the derivatives (.csv or .parquet).
        of: effort, contact_force, acceleration, pose, joint, contact_point or singularity_ratio;
            several times for several. Default: effort.
        wrt: q, v, a, wrench, at, effort, gravity, base, or the path of a number of the
            mechanism file such as platform.mass; several times for several. Default: q.
        zeros: Write zeros where a number cannot matter, instead of failing.
    """
    asked = model.of(mechanism, distribution)
    report = condyle.derivative_states(asked, states, out, strict=STRICT.get(), **given)
    return answer(report, command_line("view", mechanism))


@to_compute(
    "pose jaw.toml --joints encoders.csv --out poses.csv",
    "results.pose_rows:pose_states",
    without="every",
)
def pose(
    mechanism: str,
    *,
    joints: Path,
    out: Path,
    all_: bool = False,
    tolerance: float = 1e-6,
    **given: Any,
) -> Answer:
    """Pose of the platform from encoder readings (forward kinematics), one per row.

    Readings in, pose X, Y, Z (m), alpha, beta, gamma (rad) out.

    Args:
        out: File for the poses (.csv or .parquet).
        all_: List all assembly modes that a random search finds; it may miss some.
        seed: Seed of the search of --all. Default: 0.
    """
    report = condyle.pose_states(mechanism, joints, out, every=all_, tolerance=tolerance, **given)
    return answer(report, command_line("view", mechanism), report.data["files"])
