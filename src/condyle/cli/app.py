"""The command line as a whole: every command, and what becomes of errors, signals and streams.

Streams may be closed or broken: what is said on them never decides how a command ends.
"""

from __future__ import annotations

import io
import json
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, suppress
from typing import Any, TextIO

import typer

from ..errors import CondyleError
from . import commands, options
from .answer import plain
from .command import app

__all__ = ["app", "commands", "run"]

# Of click, or of what typer carries in its place.
Usage: Any = next(k for k in typer.BadParameter.__mro__ if k.__name__ == "ClickException")
INTERRUPTED = 130  # what shells take for Ctrl-C


def run() -> None:
    """Run the command that `sys.argv` names, and end the process with its exit status."""
    with _ending_in_order(), redirect_stderr(Forgiving(sys.stderr)):
        sys.exit(_status(as_json="--json" in sys.argv[1:]))


def _status(as_json: bool) -> int:
    """Run the command; returns 0, or the exit status of its error, which is said as JSON too."""
    try:
        return app(standalone_mode=False) or 0
    except typer.Abort as stop:  # click's of Ctrl-C, after an empty line
        print(f"condyle: {stop.__context__ or 'stopped'}", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # who reads our results went away
        drop(sys.stdout)
        return 1
    except Usage as error:
        message, hint = usage_of(error)
        if message:  # none where help was shown in the place of a command
            print(f"condyle: {message} {hint}", file=sys.stderr)
        facts = {"kind": "usage", "message": message, "hint": hint}
    except CondyleError as error:
        print(f"condyle: {error}", file=sys.stderr)
        facts = error.to_dict()
    except OSError as error:  # of the machine, such as a folder that went away
        print(f"condyle: {error}", file=sys.stderr)
        facts = {"kind": "system", "message": str(error), "hint": ""}
    if as_json:
        try:
            print(json.dumps({"error": plain(facts)}, indent=2, allow_nan=False), flush=True)
        except OSError:
            drop(sys.stdout)
    return 2


def usage_of(error: Any) -> tuple[str, str]:
    """An error of words that are no command line: what is wrong, and what to do."""
    context, message = getattr(error, "ctx", None), error.format_message().rstrip(".")
    option = getattr(getattr(error, "param", None), "name", "")
    missing = type(error).__name__ == "MissingParameter"
    hint = options.STARTERS.get(option, "") if missing else ""
    where = context.command_path if context else "condyle COMMAND"
    message = message if message.endswith(("?", ")")) or not message else f"{message}."
    return message, f"{hint} Help: {where} --help".strip()


def _terminated(number: int, frame: object) -> None:
    sys.exit(128 + number)


@contextmanager
def _ending_in_order() -> Iterator[None]:
    """End by signals as by errors, so that half-written files are removed."""
    taken = []
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) == signal.SIG_DFL:
            with suppress(ValueError):  # not the main thread
                signal.signal(number, _terminated)
                taken.append(number)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


class Forgiving:
    """A text stream that nobody may be reading; None stands for one closed from the start."""

    def __init__(self, stream: TextIO | None) -> None:
        self._stream: TextIO = stream or io.StringIO()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        with self._forgiven():
            try:
                self._stream.write(text)
            except UnicodeError:  # a file name that is no text
                self._stream.write(text.encode("ascii", "backslashreplace").decode())
        return len(text)

    def flush(self) -> None:
        with self._forgiven():
            self._stream.flush()

    @contextmanager
    def _forgiven(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError):
            drop(self._stream)
            self._stream = io.StringIO()


def drop(stream: Any) -> None:
    """Let what is left of a stream go nowhere, so that Python's own last flush cannot fail."""
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
