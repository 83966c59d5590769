"""What a command says in the end: to people, to programs, or hardly anything."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import typer

from ..errors import printable
from .options import Group

FEW = 4  # files that a line names


@dataclass(frozen=True)
class Answer:
    """The outcome of a command.

    text: for people.
    data: the same for programs; its keys are listed in docs/reference/cli.md.
    then: what to try next, a command that works as it stands.
    kind: "summary" of files that were written, which --quiet leaves out; "result", asked for
          itself; or "document", to be sent to a file, so that nothing else stands on stdout.
    failed: the exit status is 1, though nothing went wrong: the answer is no.
    """

    text: str
    data: Mapping[str, Any]
    then: str
    kind: Literal["summary", "result", "document"] = "summary"
    failed: bool = False

    def give(self, quiet: bool, as_json: bool) -> None:
        """Print it."""
        if as_json:
            typer.echo(json.dumps(plain(self.data), indent=2, allow_nan=False))
            return
        if not quiet or self.kind != "summary":
            typer.echo(printable(self.text))
        if not quiet:
            typer.echo(printable(f"Next: {self.then}"), err=self.kind == "document")


def files_line(files: list[Path]) -> str:
    """'Results: a.nc, a.csv'; of many files the first few."""
    few = files if len(files) <= FEW else files[: FEW - 1]
    more = f" and {len(files) - len(few)} more in {files[0].parent}" if few != files else ""
    return f"Results: {', '.join(map(str, few))}{more}"


def command_line(command: str, *words: object, **options: object) -> str:
    """A command to copy into a shell; options that are None or False are left out.

    Args: words: arguments, and groups of options, of which those are said that were given.
    """
    parts = ["condyle", command]
    for word in words:
        if isinstance(word, Group):
            options = word.given() | options
        else:
            parts.append(str(word))
    for name, value in options.items():
        if value is not None and value is not False:
            parts.append(f"--{name.replace('_', '-')}")
            parts += [] if value is True else [str(value)]
    return shlex.join(parts)


def plain(value: Any) -> Any:
    """Data as JSON has it: a number that is not finite is null, a path is text."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value
