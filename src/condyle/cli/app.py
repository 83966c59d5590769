"""The command line: one thin file a command, errors on stderr with exit status 2."""

from __future__ import annotations

import signal
import sys
from contextlib import suppress
from typing import Annotated

import typer

from .. import __version__
from ..errors import CondyleError

MAIN, LOOK, MAKE = "Compute", "Look", "Files and upkeep"

app = typer.Typer(
    name="condyle",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help=(
        "Dynamics of redundantly actuated parallel mechanisms whose platform the base also holds "
        "at point contacts."
    ),
    epilog="Start with [bold]condyle run[/bold]: it solves the bundled chewing robot.",
)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"condyle {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


def _terminated(number: int, frame: object) -> None:
    sys.exit(128 + number)


def _end_in_order() -> None:
    """End by signals as by errors, so that half-written files are removed."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) == signal.SIG_DFL:
            with suppress(ValueError):  # not the main thread
                signal.signal(number, _terminated)


def main() -> None:
    """Entry point of the `condyle` command."""
    from . import commands  # noqa: F401 - registers them

    _end_in_order()
    try:
        app()
    except CondyleError as error:
        print(f"condyle: {error}", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
