"""condyle plot: figures of a solution."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError, did_you_mean
from .app import LOOK, app
from .inputs import output_folder


@app.command(rich_help_panel=LOOK)
def plot(
    solution: Annotated[
        Path | None, typer.Argument(help="Solution (.nc) of a run. Without: list the figures.")
    ] = None,
    figure: Annotated[
        list[str] | None, typer.Option(help="Figure to draw; repeat for more. Default: all.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for PNG and SVG files.")] = Path("figures"),
) -> None:
    """List the figures, or draw them from a solution."""
    import condyle

    from ..report.figures import PLOTS, save

    for name in figure or ():
        if name not in PLOTS:
            raise InputError(f'no figure "{name}".{did_you_mean(name, PLOTS)}')
    if solution is None:
        for name, draw in PLOTS.items():
            typer.echo(f"{name:<14} {(draw.__doc__ or '').strip().splitlines()[0]}")
        typer.echo("Next: condyle plot results/masticatory.nc --figure torque")
        return
    data = condyle.open_solution(solution)
    folder = output_folder(out)
    for name in figure or PLOTS:
        for path in save(PLOTS[name](data), folder, name):
            typer.echo(f"Wrote {path}")
