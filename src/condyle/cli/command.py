"""What a command is: a function that does its work and returns an `Answer`.

That the answer is printed for people, as JSON or not at all, that warnings may be errors, and that
a bar shows how far the work is, is the same for all and stands here.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import fields, is_dataclass
from functools import wraps
from typing import Annotated, Any, get_args, get_type_hints

import typer
from typer.models import OptionInfo

from ..version import __version__
from . import completion, options
from .answer import Answer
from .bar import progress_bar
from .inputs import strictly

# The chapters of the help page.
START, COMPUTE, INSPECT, MAINTENANCE = "Start", "Compute", "Inspect", "Maintenance"

app = typer.Typer(
    name="condyle",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help=(
        "Dynamics of parallel robots whose platform is also constrained by point contacts with "
        "the base, as a jaw is: actuator efforts, contact forces, poses, simulation, C code."
    ),
    epilog="Start with [bold]condyle run[/bold]: it solves the bundled chewing robot. "
    "[bold]condyle COMMAND --help[/bold] shows units and an example. Every command takes "
    "[bold]--strict[/bold]: warnings are errors then.",
)

Command = Callable[..., Answer]
OPTION = re.compile(r"^ {4}(\w+): (.+(?:\n {8}.+)*)", re.MULTILINE)  # of a docstring
SWITCHES = [
    inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
    for name, kind in (
        ("quiet", options.Quiet),
        ("as_json", options.Json),
        ("strict", options.Strict),
    )
]


def group(name: str, chapter: str, help: str) -> typer.Typer:
    """Register a family of commands: `condyle NAME COMMAND`."""
    made = typer.Typer(no_args_is_help=True, rich_markup_mode="rich", help=help)
    app.add_typer(made, name=name, rich_help_panel=chapter)
    return made


def command(
    chapter: str, *, example: str, of: typer.Typer = app, name: str | None = None
) -> Callable[[Command], Command]:
    """Register a function as the command of its name, with the switches that every command has.

    Its parameters are the command's arguments and options; one whose type is a group of `options`
    stands for all of its fields. What options of its own are for is said by its docstring, below
    "Options:".

    Args: chapter: of the help page;  example: one line to copy, shown below the options.
          of: the family it belongs to;  name: where it is not the function's.
    """

    def register(work: Command) -> Command:
        hints = get_type_hints(work)
        del hints["return"]
        groups: dict[str, Any] = {n: kind for n, kind in hints.items() if is_dataclass(kind)}

        @wraps(work)
        def shown(*, quiet: bool, as_json: bool, strict: bool, **given: Any) -> None:
            for name, group in groups.items():
                given[name] = group(**{one.name: given.pop(one.name) for one in fields(group)})
            with progress_bar(not quiet and not as_json), strictly(strict):
                answer = work(**given)
            answer.give(quiet, as_json)
            if answer.failed:
                raise typer.Exit(1)

        # The help page breaks lines where the terminal ends, not where the source does.
        text, _, said = inspect.cleandoc(work.__doc__ or "").partition("\n\nOptions:\n")
        shown.__doc__ = plain("\n\n".join(" ".join(part.split()) for part in text.split("\n\n")))
        helps = {name: " ".join(words.split()) for name, words in OPTION.findall(said)}
        parameters = [*_parameters(work, helps), *SWITCHES]
        shown.__annotations__ = {one.name: one.annotation for one in parameters}
        shown.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        of.command(name, rich_help_panel=chapter, epilog=f"Example: {example}")(shown)
        return work

    return register


def plain(text: str) -> str:
    """Text whose brackets are no markup: help pages would leave out [s] and [controller]."""
    return re.sub(r"(?<!\\)\[(?=[a-zA-Z/#@])", r"\[", text)


def registered() -> Iterator[tuple[str, Any]]:
    """Every command by the words that call it, "motion from-c3d", with what typer knows of it."""
    families = [("", app)] + [(f"{g.name} ", g.typer_instance) for g in app.registered_groups]
    for family, of in families:
        for one in of.registered_commands if of is not None else ():
            assert one.callback is not None
            yield family + (one.name or one.callback.__name__), one


def _parameters(work: Callable[..., Any], helps: dict[str, str]) -> Iterator[inspect.Parameter]:
    """Arguments and options of a function, groups as their fields, each as typer wants it."""
    hints = get_type_hints(work, include_extras=True)
    for one in inspect.signature(work).parameters.values():
        kind = hints[one.name]
        if is_dataclass(kind):
            yield from _parameters(kind, helps)  # type: ignore[arg-type]
        else:
            made = one.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            yield made.replace(annotation=_annotated(made, kind, helps))


def _annotated(one: inspect.Parameter, kind: Any, helps: dict[str, str]) -> Any:
    """A type with typer's description of the option; a switch that is off has no opposite."""
    kind, info = (get_args(kind)) if hasattr(kind, "__metadata__") else (kind, options.option())
    if isinstance(info, OptionInfo):
        info = copy(info)
        info.help = plain(info.help or helps[one.name])
        info.autocompletion = info.autocompletion or completion.OFFERED.get(one.name)
        if one.default is False and info.default is ... and not info.param_decls:
            info.param_decls = (f"--{one.name.replace('_', '-')}",)
    return Annotated[kind, info]


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
