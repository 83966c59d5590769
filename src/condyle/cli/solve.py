"""condyle solve: inverse dynamics of independent states, one per row."""

from __future__ import annotations

from pathlib import Path

from . import options
from .answer import Answer, command_line
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
) -> Answer:
    """Inverse dynamics of independent states, one per row.

    For tables of any length: rows never influence each other.

    Options:
        states: States (CSV or Parquet), one per row: pose coordinates such as X, Y (m), alpha, beta
            (rad), their rates dX ... (per s) and accelerations ddX ... (per s^2; at rest without
            both), and, if any, Fx, Fy, Fz (N), Mx, My, Mz (N m).
        out: File for the results (.csv or .parquet).
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
    )
    warn(solved.data["warnings"])
    return Answer(str(solved), solved.data, command_line("view", mechanism))
