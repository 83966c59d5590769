"""condyle report: a page to send."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..extras import require
from . import options
from .answer import Answer, command_line
from .command import LOOK, command


@command(LOOK, example="condyle report results/masticatory.nc")
def report(
    solution: Annotated[Path, typer.Argument(help="Results (.nc) of a run.")],
    out: Annotated[
        Path | None, typer.Option(help="HTML file. Default: beside the results.")
    ] = None,
    measured: options.Measured = None,
    file: Annotated[
        list[Path] | None,
        typer.Option(help="Input of the run to name with its hash; repeat for more."),
    ] = None,
    sweep: Annotated[
        Path | None, typer.Option(help="Folder of a sweep, to show on the page too.")
    ] = None,
) -> Answer:
    """A run as one web page to send.

    One HTML file that opens without a network: the moving mechanism, linked plots, tables and
    every warning.
    """
    require("plotly", "report")
    from ..report.page import write_report

    beside = solution.parent / f"{solution.stem}.html"
    found = None
    if sweep is not None:
        require("matplotlib", "figures")
        from ..analysis.sweep import read_sweep

        found = read_sweep(sweep)
    inputs = [solution, *([measured] if measured else []), *(file or ())]
    path = write_report(solution, out or beside, files=inputs, measured=measured, sweep=found)
    size = path.stat().st_size
    return Answer(
        f"Wrote {path} ({size / 1e6:.1f} MB); open it in a browser",
        {"files": [path], "bytes": size},
        command_line("view", solution=solution),
    )
