"""condyle new: a first mechanism file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .app import MAKE, app


@app.command(rich_help_panel=MAKE)
def new(
    name: Annotated[str, typer.Argument(help="Name of the mechanism; the file is NAME.toml.")],
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a commented starter file: a small mechanism that works, to change step by step."""
    from ..atomic import write_text
    from ..mechanism import parse
    from ..mechanism.starter import starter_text

    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if path.exists() and not force:
        raise InputError(f"{path} exists already; choose another name or add --force")
    stem = path.name.removesuffix(".toml")
    text = starter_text(stem)
    try:
        parse(text)
    except InputError:
        raise InputError(
            f'"{stem}" cannot be the name of a mechanism; use letters, digits, - and _'
        ) from None
    write_text(path, text)
    typer.echo(f"Wrote {path}. Next: condyle check {path}")
