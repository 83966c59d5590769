"""condyle solve: independent states, one a row."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import options
from .app import MAIN, app
from .inputs import say, warn


@app.command(rich_help_panel=MAIN)
def solve(
    mechanism: options.Mechanism,
    states: Annotated[Path, typer.Option(help="States to solve (CSV), one a row.")],
    out: Annotated[Path, typer.Option(help="File for the results (CSV).")],
    load_point: options.LoadPoint = None,
    formulation: options.Formulation = "virtual_power",
    route: options.Route = "core",
    reactions: options.Reactions = False,
    backend: options.Backend = "auto",
    threads: options.Threads = None,
    strict: options.Strict = False,
    flag: options.Flag = False,
    quiet: options.Quiet = False,
) -> None:
    """Torques of independent states: pose coordinates, rates (dX), accelerations (ddX), Fx ..."""
    import condyle

    from ..states import solve_file

    model = condyle.derive(condyle.load(mechanism), formulation, route, backend)
    rows, warnings = solve_file(model, states, out, load_point, flag, strict, reactions, threads)
    warn(warnings)
    say(quiet, f"{rows} rows solved: {out}")
