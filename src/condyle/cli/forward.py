"""condyle forward: forward dynamics of independent states, one per row."""

from __future__ import annotations

from pathlib import Path

from . import options
from .answer import Answer, command_line
from .command import COMPUTE, command
from .inputs import STRICT, model_of, warn


@command(COMPUTE, example="condyle forward jaw.toml --states states.csv --out accelerations.csv")
def forward(
    mechanism: options.Mechanism,
    states: Path,
    out: Path,
    model: options.ModelOptions,
    load_point: options.LoadPoint = None,
    flag: options.Flag = False,
) -> Answer:
    """Forward dynamics of independent states, one per row.

    Accelerations and contact forces under given efforts and a load. Rows never influence each
    other.

    Options:
        states: States and efforts (CSV or Parquet), one per row: pose coordinates such as X, Y (m),
            alpha, beta (rad), their rates dX ... (per s), tau_CHAIN of every chain (N m, or N where
            it slides or pulls), and, if any, Fx, Fy, Fz (N), Mx, My, Mz (N m).
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
    )
    warn(solved.data["warnings"])
    return Answer(str(solved), solved.data, command_line("view", mechanism))
