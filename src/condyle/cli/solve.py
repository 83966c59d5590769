"""condyle solve: independent states, one a row."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError
from . import options
from .answer import Answer, command_line
from .command import COMPUTE, command
from .inputs import chosen_model, warn


@command(COMPUTE, example="condyle solve jaw.toml --states states.csv --out torques.csv")
def solve(
    mechanism: options.Mechanism,
    states: Path,
    out: Path,
    load_point: str | None = None,
    formulation: str = "virtual_power",
    route: str = "core",
    distribution: str | None = None,
    preload: float = 0.0,
    contact_weight: float = 0.0,
    reactions: bool = False,
    mat: bool = False,
    backend: str = "auto",
    threads: int | None = None,
    strict: bool = False,
    flag: bool = False,
) -> Answer:
    """The same for separate states, one a row.

    For tables of any length: rows never influence each other.

    Options:
        states: States to solve (CSV or Parquet), one a row: pose coordinates such as X, Y (m),
            alpha, beta (rad), their rates dX ... (per s) and accelerations ddX ... (per s^2;
            without both: at rest), and if you like some of Fx, Fy, Fz (N), Mx, My, Mz (N m).
        out: File for the results (.csv or .parquet).
    """
    import condyle

    from ..results.inverse_rows import solve_file

    if mat and out.suffix.lower() == ".mat":
        raise InputError(f"--out {out}: --mat writes that file; give the table another name")
    machine, policy = condyle.load_mechanism(mechanism), (distribution, preload, contact_weight)
    model = chosen_model(machine, formulation, route, backend, *policy)
    files = [out, out.with_suffix(".mat")] if mat else [out]
    how = load_point, flag, strict, reactions, threads
    solved = solve_file(model, states, out, *how, mat=files[1] if mat else None)
    rows, warnings, greatest = solved
    warn(warnings)
    data = {
        "mechanism": model.mechanism.name,
        "formulation": model.formulation,
        "route": model.route,
        "distribution": model.policy.objective,
        "rows": rows,
        "greatest_activation": None if greatest is None else greatest._asdict(),
        "warnings": warnings,
        "files": files,
    }
    text = f"{rows} rows solved: {', '.join(map(str, files))}"
    if greatest is not None:
        value, chain, row = greatest
        text += f"\nGreatest activation (effort over its limit): {value:.4g}, {chain} in row {row}"
    return Answer(text, data, command_line("view", mechanism))
