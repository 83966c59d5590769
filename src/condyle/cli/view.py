"""condyle view: the mechanism to move by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..extras import require
from . import options
from .answer import command_line
from .command import LOOK, app


@app.command(rich_help_panel=LOOK, epilog="Example: condyle view jaw.toml")
def view(
    mechanism: options.Mechanism = "masticatory",
    solution: Annotated[
        Path | None, typer.Option(help="Results (.nc) to play back; they bring their mechanism.")
    ] = None,
    map: Annotated[
        Path | None,
        typer.Option(
            help="A map over two or three coordinates (.nc or .zarr) to turn and to click; it "
            "brings its mechanism."
        ),
    ] = None,
    simulate: Annotated[
        Path | None,
        typer.Option(
            help="Scenario (TOML) to run live, as of condyle simulate: turn gains and food while "
            "it runs, and pull the platform with the mouse.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(help="Port on 127.0.0.1.", min=1, max=65535)] = 8080,
    browser: Annotated[bool, typer.Option(help="Open the page in a browser.")] = True,
    quiet: options.Quiet = False,
) -> None:
    """A mechanism to move by hand, in the browser.

    A page of this machine alone: move the platform and read torques, contact forces and reach,
    play back a run, or simulate one while you look. It stays until Ctrl-C.
    """
    require("viser", "view")
    from ..view import serve

    own = solution is None and map is None
    serve(
        mechanism if own else None,
        solution,
        port=port,
        open_browser=browser,
        map=map,
        scenario=simulate,
    )
    if not quiet:
        then = ("report", solution) if solution else ("check", mechanism)
        line = command_line(*then)
        if simulate is not None:
            line = command_line("simulate", mechanism, scenario=simulate)
        typer.echo(f"Next: {line}")
