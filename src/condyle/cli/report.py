"""condyle report: a page to send."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..extras import require
from .answer import Answer, command_line
from .command import LOOK, command


@command(LOOK, example="condyle report results/masticatory.nc")
def report(
    solution: Annotated[Path, typer.Argument(help="Results (.nc) of a run.")],
    out: Path | None = None,
    measured: Path | None = None,
    file: list[Path] | None = None,
    sweep: Path | None = None,
) -> Answer:
    """A run as one web page to send.

    One HTML file that opens without a network: the moving mechanism, linked plots, tables and
    every warning.

    Options:
        out: HTML file. Default: beside the results.
        file: Input of the run to name with its hash; repeat for more.
        sweep: Folder of a sweep, to show on the page too.
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
