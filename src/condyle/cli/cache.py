"""condyle cache: compiled kernels on disk."""

from __future__ import annotations

from typing import Annotated

import typer

from .app import MAKE, app


@app.command(rich_help_panel=MAKE)
def cache(
    clear: Annotated[bool, typer.Option("--clear", help="Remove every kernel.")] = False,
) -> None:
    """Show or clear the compiled kernels."""
    from ..kernels import cache as kernels

    had = kernels.clear() if clear else kernels.contents()
    count = "1 kernel" if had.kernels == 1 else f"{had.kernels} kernels"
    what = f"{count}, {had.size / 1e6:.1f} MB"
    typer.echo(f"Removed {what} from {had.folder}" if clear else f"{had.folder}: {what}")
    if not clear and had.size:
        typer.echo("Next: condyle cache --clear removes them; they are built again when needed")
