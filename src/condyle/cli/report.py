"""condyle report: a page to send."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..extras import require
from . import options
from .answer import Answer, command_line
from .command import INSPECT, command


@command(INSPECT, example="condyle report results/masticatory.nc")
def report(
    solution: Annotated[Path, typer.Argument(help="Results (.nc) of a run.")],
    out: Path | None = None,
    measured: options.Measured = None,
    file: list[Path] | None = None,
    sweep: Path | None = None,
) -> Answer:
    """Report of a run: one HTML file to send.

    It opens without a network: the moving mechanism, linked plots, tables and every warning.

    Options:
        out: HTML file. Default: next to the results.
        file: Input file of the run, to be listed with its hash; repeat for more.
        sweep: Folder of a sweep, to be shown too.
    """
    require("plotly", "report")
    import condyle

    beside = solution.parent / f"{solution.stem}.html"
    found = None
    if sweep is not None:
        require("matplotlib", "figures")
        from ..analysis.sweep import open_sweep

        found = open_sweep(sweep)
    inputs = [solution, *([measured] if measured else []), *(file or ())]
    path = condyle.write_report(
        solution, out or beside, files=inputs, measured=measured, sweep=found
    )
    size = path.stat().st_size
    return Answer(
        f"Wrote {path} ({size / 1e6:.1f} MB); open it in a browser",
        {"files": [path], "bytes": size},
        command_line("view", solution=solution),
    )
