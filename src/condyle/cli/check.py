"""condyle check: what a mechanism is, and what is wrong with it."""

from __future__ import annotations

import typer

from . import options
from .app import LOOK, app
from .inputs import say_json, warn


@app.command(rich_help_panel=LOOK)
def check(mechanism: options.Mechanism, as_json: options.Json = False) -> None:
    """Describe a mechanism at home, or list every problem in its file."""
    import condyle

    from ..mechanism.home import home_warnings
    from ..report.check import describe

    machine = condyle.load(mechanism)
    description = describe(machine)
    warn(home_warnings(machine))
    if as_json:
        say_json(description.data)
        return
    typer.echo(str(description))
    typer.echo(f"\nNext: condyle run {mechanism}")
