"""condyle bench: how fast, beside other engines."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from .app import LOOK, app


@app.command(rich_help_panel=LOOK)
def bench(
    out: Annotated[Path | None, typer.Option(help="JSON file for the results.")] = None,
    seconds: Annotated[float, typer.Option(help="Timing, a row.", min=0.01)] = 1.0,
) -> None:
    """Time the kernels, the interpreter and, from the repository, other engines: one table."""
    from ..atomic import write_text
    from ..bench import run_benchmark

    result = run_benchmark(seconds, say=lambda text: typer.echo(text, err=True))
    typer.echo(str(result))
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_text(out, json.dumps(result.data(), indent=1))
        typer.echo(f"Results: {out}")
