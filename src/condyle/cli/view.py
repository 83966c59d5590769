"""condyle view: the mechanism to move by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..extras import require
from . import options
from .answer import command_line
from .command import INSPECT, app
from .inputs import strictly
from .options import option


@app.command(rich_help_panel=INSPECT, epilog="Example: condyle view jaw.toml")
def view(
    mechanism: options.Mechanism = "masticatory",
    solution: Annotated[
        Path | None, option("Results (.nc) to play back; they contain their mechanism.")
    ] = None,
    map: Annotated[
        Path | None,
        option(
            "Map over two or three coordinates (.nc) to rotate and to click; it contains "
            "its mechanism."
        ),
    ] = None,
    simulate: Annotated[
        Path | None,
        option(
            "Scenario (TOML) to simulate live: change gains and food while it runs, and pull the "
            "platform with the mouse.",
        ),
    ] = None,
    port: Annotated[int, option("Port on 127.0.0.1.", min=1, max=65535)] = 8080,
    browser: Annotated[bool, option("Open the page in a browser.")] = True,
    quiet: options.Quiet = False,
    strict: options.Strict = False,
) -> None:
    """Interactive 3D view in the browser.

    A page that only this machine can open: move the platform and read efforts, contact forces and
    reach, play back a run, or simulate live. It runs until Ctrl-C.
    """
    require("viser", "view")
    import condyle

    own = mechanism if solution is None and map is None else None
    with strictly(strict):
        condyle.serve_view(
            own, solution, port=port, open_browser=browser, map=map, scenario=simulate
        )
    if quiet:
        return
    if simulate is not None:
        line = command_line("simulate", mechanism, scenario=simulate)
    else:
        line = command_line("report", solution) if solution else command_line("check", mechanism)
    typer.echo(f"Next: {line}")
