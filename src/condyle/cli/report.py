"""condyle report: a page to send."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .app import LOOK, app


@app.command(rich_help_panel=LOOK)
def report(
    solution: Annotated[Path, typer.Argument(help="Solution (.nc) of a run.")],
    out: Annotated[
        Path | None, typer.Option(help="HTML file. Default: beside the solution.")
    ] = None,
    file: Annotated[
        list[Path] | None,
        typer.Option(help="Input of the run to name with its hash; repeat for more."),
    ] = None,
) -> None:
    """One HTML file that shows a solution: moving mechanism, linked plots, tables, warnings."""
    import condyle

    from ..report.page import write_report

    data = condyle.open_solution(solution)
    path = write_report(data, out or solution.with_suffix(".html"), files=[solution, *(file or ())])
    typer.echo(f"Wrote {path} ({path.stat().st_size / 1e6:.1f} MB). Next: open it in a browser")
