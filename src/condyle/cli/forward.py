"""condyle forward: forward dynamics."""

from __future__ import annotations

from pathlib import Path

from . import options
from .answer import Answer, command_line
from .command import COMPUTE, command
from .inputs import warn


@command(COMPUTE, example="condyle forward jaw.toml --states states.csv --out accelerations.csv")
def forward(
    mechanism: options.Mechanism,
    states: Path,
    out: Path,
    load_point: str | None = None,
    formulation: str = "virtual_power",
    backend: str = "auto",
    threads: int | None = None,
    flag: bool = False,
) -> Answer:
    """Accelerations from efforts and load, one state a row.

    Forward dynamics: what the mechanism does under given efforts, and what its contacts carry.
    Rows never influence each other.

    Options:
        states: States and efforts (CSV or Parquet), one a row: pose coordinates such as X, Y (m),
            alpha, beta (rad), their rates dX ... (per s), tau_CHAIN of every chain (N m, or N where
            it slides or pulls), and if you like some of Fx, Fy, Fz (N), Mx, My, Mz (N m).
        out: File for the results (.csv or .parquet).
    """
    import condyle

    from ..results.forward_rows import forward_file

    model = condyle.derive(condyle.load_mechanism(mechanism), formulation, backend=backend)
    rows, warnings = forward_file(model, states, out, load_point, flag, threads)
    warn(warnings)
    data = {
        "mechanism": model.mechanism.name,
        "formulation": model.formulation,
        "rows": rows,
        "warnings": warnings,
        "files": [out],
    }
    then = command_line("view", mechanism)
    return Answer(f"{rows} rows solved: {out}", data, then)
