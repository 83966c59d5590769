"""condyle view: the mechanism to move by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import options
from .app import LOOK, app


@app.command(rich_help_panel=LOOK)
def view(
    mechanism: options.Mechanism = "masticatory",
    solution: Annotated[
        Path | None, typer.Option(help="Solution (.nc) to play back; brings its own mechanism.")
    ] = None,
    port: Annotated[int, typer.Option(help="Port on 127.0.0.1.", min=1, max=65535)] = 8080,
    browser: Annotated[bool, typer.Option(help="Open the page in a browser.")] = True,
) -> None:
    """A local page on which to move the platform and read torques, forces and reach."""
    from ..view import serve

    serve(None if solution else mechanism, solution, port=port, open_browser=browser)
