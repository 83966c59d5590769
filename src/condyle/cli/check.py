"""condyle check: what a mechanism is, and what is wrong with it."""

from __future__ import annotations

from typing import Annotated

import typer

from . import options
from .app import LOOK, app
from .inputs import say_json, warn

Project = Annotated[
    bool,
    typer.Option(
        "--project",
        help="Where contact points are off their surfaces: show the nearest home on them.",
    ),
]


@app.command(rich_help_panel=LOOK)
def check(
    mechanism: options.Mechanism, project: Project = False, as_json: options.Json = False
) -> None:
    """Describe a mechanism at home, or list every problem in its file."""
    import condyle

    from ..mechanism.home import home_warnings
    from ..report.check import describe

    if project and _show_projection(mechanism, as_json):
        return
    machine = condyle.load(mechanism)
    description = describe(machine)
    warn(home_warnings(machine))
    if as_json:
        say_json(description.data)
        return
    typer.echo(str(description))
    typer.echo(f"\nNext: condyle run {mechanism}")


def _show_projection(mechanism: str, as_json: bool) -> bool:
    """Show the nearest home on the surfaces; False if the file's home is there already."""
    from ..kinematics.project import project_home
    from ..mechanism.files import from_data, read_tables, read_text
    from ..mechanism.quantities import PER_METRE

    tables = read_tables(read_text(mechanism), mechanism)
    projection = project_home(from_data(tables, mechanism, at_home=False))
    if not projection.needed:
        return False
    if as_json:
        say_json(projection.data())
    else:
        typer.echo(projection.text(PER_METRE[tables.get("length_unit", "m")]))
        typer.echo(f"\nNext: change the points in the file, then condyle check {mechanism}")
    return True
