"""What a command says in the end: to people, to programs, or hardly anything."""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import typer

from ..errors import WarningError, printable
from .options import Group

NO, NOT_JUDGED = 1, 3  # exit statuses; 2 is of errors
FEW = 4  # files that a line names
STRICT: ContextVar[bool] = ContextVar("strict", default=False)  # of the command that runs


@dataclass(frozen=True)
class Answer:
    """The outcome of a command.

    text: for people.
    data: the same for programs; its keys are listed in docs/reference/cli.md.
    then: the next step, a command that works as it stands; "" where there is none.
    kind: "summary" of files that were written, which --quiet leaves out; or "result", asked for
          itself.
    status: the exit status, though nothing went wrong: `NO` and `NOT_JUDGED` are answers.
    """

    text: str
    data: Mapping[str, Any]
    then: str = ""
    kind: Literal["summary", "result"] = "summary"
    status: int = 0

    def give(self, quiet: bool, as_json: bool) -> None:
        """Print it."""
        if as_json:
            typer.echo(json.dumps(plain(self.data), indent=2, allow_nan=False))
            return
        if self.text and not (quiet and self.kind == "summary"):
            typer.echo(printable(self.text))
        if self.then and not quiet:
            typer.echo(printable(f"Next: {self.then}"))


def answer(
    result: Any,
    then: str = "",
    files: list[Path] | None = None,
    save: Path | None = None,
    report: Path | None = None,
) -> Answer:
    """The answer to a call of the library: its warnings, text, data and files.

    Args: files: written already;  save, report: files to write, after the warnings.
    """
    warn(getattr(result, "warnings", None) or result.data.get("warnings", ()))
    for file, write in ((save, "save"), (report, "write_report")):
        if file is not None:
            getattr(result, write)(file)
            files = [*(files or ()), file]
    text = f"{result}\n{files_line(files)}" if files else str(result)
    data = dict(result.data) if files is None else {**result.data, "files": files}
    return Answer(text, data, then, "summary" if data.get("files") else "result")


def warn(warnings: Iterable[str]) -> None:
    """Warnings on stderr, so that they never mix with results.

    Raises: WarningError: where the command is strict; call it before results are written.
    """
    said = list(dict.fromkeys(warnings))
    if said and STRICT.get():
        raise WarningError(said)
    for warning in said:
        print(f"condyle: warning: {warning}", file=sys.stderr)


@contextmanager
def strictly(strict: bool) -> Iterator[None]:
    """Whether warnings are errors within the block."""
    token = STRICT.set(strict)
    try:
        yield
    finally:
        STRICT.reset(token)


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
