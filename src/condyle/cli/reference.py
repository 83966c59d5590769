"""condyle reference: the bundled motion and load as files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .app import MAKE, app
from .inputs import output_folder


@app.command(rich_help_panel=MAKE)
def reference(
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path(),
) -> None:
    """Write the reference chewing path and bite force. Both are synthetic, not measured."""
    from ..motion import write_reference

    output_folder(out)
    for path in write_reference(out):
        typer.echo(f"Wrote {path}")
    typer.echo("Next: condyle run --motion " + str(out / "chewing-incisor.csv"))
