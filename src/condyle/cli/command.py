"""What a command is: a function that does its work and returns an `Answer`.

That the answer is printed for people, as JSON or not at all, and that a bar shows how far the
work is, is the same for all and stands here.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from functools import wraps
from typing import Annotated, Any, get_type_hints

import typer

from ..version import __version__
from . import completion, options
from .answer import Answer
from .bar import progress_bar

# The chapters of the help page.
BEGIN, COMPUTE, LOOK, UPKEEP = "Begin", "Compute", "Look", "Upkeep"

app = typer.Typer(
    name="condyle",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help=(
        "Motor torques and contact forces of parallel robots whose platform also touches the "
        "base, as a jaw does."
    ),
    epilog="Start with [bold]condyle run[/bold]: it solves the bundled chewing robot. "
    "[bold]condyle COMMAND --help[/bold] shows units and an example.",
)

Command = Callable[..., Answer]
OPTION = re.compile(r"^ {4}(\w+): (.+(?:\n {8}.+)*)", re.MULTILINE)  # of a docstring


def group(name: str, chapter: str, help: str) -> typer.Typer:
    """Register a family of commands: `condyle NAME COMMAND`."""
    made = typer.Typer(no_args_is_help=True, rich_markup_mode="rich", help=help)
    app.add_typer(made, name=name, rich_help_panel=chapter)
    return made


def command(
    chapter: str, *, example: str, of: typer.Typer = app, name: str | None = None
) -> Callable[[Command], Command]:
    """Register a function as the command of its name, with `--quiet` and `--json` as well.

    Its docstring says what its options are for, below "Options:"; those that several commands
    share are in `options`.

    Args: chapter: of the help page;  example: one line to copy, shown below the options.
          of: the family it belongs to;  name: where it is not the function's.
    """

    def register(work: Command) -> Command:
        @wraps(work)
        def shown(*, quiet: bool, as_json: bool, **given: Any) -> None:
            with progress_bar(not quiet and not as_json):
                answer = work(**given)
            answer.give(quiet, as_json)

        # The help page breaks lines where the terminal ends, not where the source does.
        text, _, told = inspect.cleandoc(work.__doc__ or "").partition("\n\nOptions:\n")
        shown.__doc__ = "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))
        helps = {name: " ".join(words.split()) for name, words in OPTION.findall(told)}
        _take(shown, work, helps, quiet=options.Quiet, as_json=options.Json)
        of.command(name, rich_help_panel=chapter, epilog=f"Example: {example}")(shown)
        return work

    return register


def registered() -> Iterator[tuple[str, Any]]:
    """Every command by the words that call it, "motion from-c3d", with what typer knows of it."""
    families = [("", app)] + [(f"{g.name} ", g.typer_instance) for g in app.registered_groups]
    for family, of in families:
        for one in of.registered_commands if of is not None else ():
            assert one.callback is not None
            yield family + (one.name or one.callback.__name__), one


def _take(
    shown: Callable[..., None], work: Command, helps: dict[str, str], **switches: Any
) -> None:
    """Give `shown` the parameters of `work` as options, and some switches."""
    hints = get_type_hints(work, include_extras=True) | switches
    hints.pop("return", None)
    parameters = list(inspect.signature(work).parameters.values())
    for one in parameters:
        if not hasattr(hints[one.name], "__metadata__"):
            hints[one.name] = Annotated[hints[one.name], _option(one, helps)]
    switch = inspect.Parameter.KEYWORD_ONLY
    parameters += [inspect.Parameter(name, switch, default=False) for name in switches]
    parameters = [one.replace(annotation=hints[one.name]) for one in parameters]
    shown.__annotations__ = hints
    shown.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]


def _option(one: inspect.Parameter, helps: dict[str, str]) -> Any:
    """A switch that is off has no opposite."""
    usual = f"--{one.name.replace('_', '-')}" if one.default is False else None
    names = [name for name in (options.NAMES.get(one.name, usual),) if name]
    text = helps.get(one.name) or options.HELP[one.name]
    offered, numbers = completion.OFFERED.get(one.name), options.RANGE.get(one.name, {})
    return typer.Option(*names, help=text, autocompletion=offered, **numbers)


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
