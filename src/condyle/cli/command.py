"""A command is its function: signature and docstring are the command's options and its help.

    @command("mass jaw.toml --unit g", "analysis.mass:mass")
    def mass(mechanism: str, *, unit: str = "kg", **given: Any) -> Answer:
        '''Mass of the moving bodies.

        Args: unit: kg or g.
        '''
        return answer(condyle.mass(mechanism, **given), command_line("check", mechanism))

Arguments come by place, keyword-only ones are options, a group of `options` is its fields, and
`given` is what else the named function of the library takes. Help is the docstring's "Args:", else
that of the options that commands share, else the library's. How the answer is said, that warnings
may be errors, and that a bar shows how far the work is, is the same for all and stands here.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import nullcontext
from copy import copy
from dataclasses import fields, is_dataclass
from functools import cache, wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer
import typer.main
from typer.core import TyperGroup

from ..errors import InputError
from ..files.reading import sparing
from ..progress import progress_bar
from ..version import __version__
from . import completion, options
from .answer import Answer, strictly
from .docstrings import function_of, kind_of, parts, sentence

# The chapters of the help page with their commands, in its order; those of other packages are last.
CHAPTERS = {
    "Start": ("new", "check", "reference"),
    "Solve": ("run", "solve", "forward", "pose", "derivatives", "simulate"),
    "Explore": ("map", "sweep", "compare", "modes"),
    "Improve": ("design", "optimise", "path"),
    "Fit": ("identify", "calibrate", "excite"),
    "Jaw": ("session", "motion", "bite", "literature"),
    "Show": ("plot", "report", "view", "video"),
    "Export": ("export",),
    "Maintenance": ("schema", "cite", "bench", "cache"),
}
FURTHER = "Of other packages"
_CHAPTER = {name: chapter for chapter, names in CHAPTERS.items() for name in names}


class Chapters(TyperGroup):
    """Commands that are read when they are called for: a page of all needs their text alone."""

    def list_commands(self, ctx: Any) -> list[str]:
        for further in further_commands if self.name == app.info.name else ():
            self.commands.update(further(self.commands))
        order = {name: place for place, name in enumerate(_CHAPTER)}
        return sorted(super().list_commands(ctx), key=lambda name: order.get(name, len(order)))

    def get_command(self, ctx: Any, name: str) -> Any:
        if name not in self.commands:
            self.list_commands(ctx)
        return super().get_command(ctx, name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name, command, rest = super().resolve_command(ctx, args)
        read = getattr(getattr(command, "callback", None), "read", lambda: command)
        return name, read(), rest


app = typer.Typer(
    name="condyle",
    cls=Chapters,
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
# From the commands that there are to others, asked where all are listed and for an unknown name.
further_commands: list[Callable[[Container[str]], Mapping[str, Any]]] = []


def family(name: str, help: str) -> typer.Typer:
    """Register a family of commands: `condyle NAME COMMAND`."""
    made = typer.Typer(
        name=name, cls=Chapters, no_args_is_help=True, rich_markup_mode="rich", help=help
    )
    app.add_typer(made, rich_help_panel=_CHAPTER[name])
    return made


def command(
    example: str,
    calls: Any = "",
    *,
    without: str = "",
    of: typer.Typer = app,
    serves: bool = False,
) -> Callable[[Command], Command]:
    """Register a function as the command of its name, with the switches that every command has.

    Args: example: one line to copy, run below the options.
          calls: function whose other arguments are options too; of the library, "room.file:name".
          without: those that are not.
          of: the family it belongs to.
          serves: it runs until it is stopped: it has no bar, and no answer for programs.
    """

    def register(work: Command) -> Command:
        def unread() -> None: ...

        name = work.__name__.strip("_").replace("_", "-")
        about: dict[str, Any] = {
            "rich_help_panel": _CHAPTER.get(of.info.name or "") or _CHAPTER.get(name, FURTHER),
            "epilog": f"Example: condyle {example}",
        }

        @cache
        def read() -> Any:
            one = typer.Typer(rich_markup_mode="rich", add_completion=False)
            one.command(name, **about)(_for_typer(work, calls, without.split(), serves))
            return typer.main.get_command(one)

        unread.__doc__ = plain(parts(work)[0] or parts(function_of(calls))[0])
        vars(unread)["read"] = read
        of.command(name, **about)(unread)
        return work

    return register


def _for_typer(work: Command, calls: Any, without: list[str], serves: bool) -> Callable[..., None]:
    """A function as typer wants it: it says the answer, and its signature has every option."""
    library = function_of(calls) if calls else work
    hints = get_type_hints(work)
    del hints["return"]
    groups: dict[str, Any] = {n: kind for n, kind in hints.items() if is_dataclass(kind)}

    @wraps(work)
    def run(*, quiet: bool, strict: bool, as_json: bool = False, **given: Any) -> None:
        inputs = _spared(given, outputs)
        for name, group in groups.items():
            given[name] = group(**{field.name: given.pop(field.name) for field in fields(group)})
        given = {n: value for n, value in given.items() if value is not None or n in hints}
        if takes_strict:
            given["strict"] = strict
        silent = quiet or as_json or serves or not sys.stderr.isatty()
        with nullcontext() if silent else progress_bar(), strictly(strict), sparing(inputs):
            answer = _by_options(work, given, options_of)
        answer.give(quiet, as_json)
        if answer.status:
            raise typer.Exit(answer.status)

    options_of = {"from_bundled": "from", "coordinates": "from", "kind": "study", "unit": "units"}
    takes_strict = "given" in hints and "strict" in inspect.signature(library).parameters
    (text, own), (summary, known) = parts(work), parts(library)
    known = {n: sentence(said, completion.listed(n)) for n, said in known.items()}
    helps = known | options.HELP | own
    parameters = [param for param in _parameters(work) if param.kind != param.VAR_KEYWORD]
    if "given" in hints:
        taken = {"strict", *without, *(param.name for param in parameters)}
        parameters += _parameters_of(library, taken)
    parameters += list(_parameters(switches))[: 2 if serves else 3]
    options_of |= {
        param.name: param.name.strip("_").replace("_", "-") * (param.kind == param.KEYWORD_ONLY)
        for param in parameters
    }
    outputs = [
        param.name for param in parameters if param.name == "out" or _is_written(param.annotation)
    ]
    parameters = [_described(param, helps) for param in parameters]
    run.__doc__ = plain(text or summary)
    run.__annotations__ = {param.name: param.annotation for param in parameters}
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run


def _spared(given: Mapping[str, Any], outputs: Container[str]) -> list[Path]:
    """The files that a command is told to read.

    Raises: InputError: where one to write is one of these, or another that is written.
    """
    files = [
        (name, Path(path))
        for name, value in given.items()
        for path in (value if isinstance(value, list) else [value])
        if isinstance(path, Path) or (name == "mechanism" and Path(path).is_file())
    ]
    for name, written in files:
        for other, path in files if name in outputs else ():
            if other != name and path.resolve() == written.resolve():
                if other in outputs:
                    both = f"--{name} and --{other} are {written}"
                    raise InputError(f"{both}: two files to write have one name")
                raise InputError(
                    f"--{name} {written} would replace the file of {other}: give another name"
                )
    return [path for name, path in files if name not in outputs]


def _is_written(annotation: Any) -> bool:
    """Whether it is of an option for a file to write, of `options.written`."""
    return any(getattr(one, "callback", None) for one in getattr(annotation, "__metadata__", ()))


def _by_options(work: Command, given: dict[str, Any], names: Mapping[str, str]) -> Answer:
    """Run a command; an error of an argument names its option.

    Args: names: of options, by the library's arguments; "" of what has no name on the line.
    """
    try:
        return work(**given)
    except InputError as error:
        argument, _, rest = error.message.partition(": ")
        if argument in names and type(error) is InputError:
            option = names[argument]
            raise InputError(f"--{option}: {rest}" if option else rest, error.hint) from None
        raise


def switches(
    *,
    quiet: Annotated[bool, typer.Option("--quiet", "-q")] = False,
    strict: bool = False,
    as_json: Annotated[bool, typer.Option("--json")] = False,
) -> None:
    """Every command has these; `options.Shared` says what they are for."""


def plain(text: str) -> str:
    """Text for help: joint_CHAIN for joint_<chain>; brackets are no markup, that would hide [s]."""
    text = re.sub(r"<(\w+)>", lambda name: name[1].upper(), text).replace("`", "")
    return re.sub(r"(?<!\\)\[(?=[a-zA-Z/#@])", r"\[", text)


def registered() -> Iterator[tuple[str, Any]]:
    """Every command, by the words that call it, "motion from-c3d", with its options."""
    commands = typer.main.get_command(app).commands.items()  # type: ignore[attr-defined]
    for name, one in commands:
        for own, member in getattr(one, "commands", {"": one}).items():
            yield f"{name} {own}".strip(), member.callback.read()


def _parameters(work: Any) -> Iterator[inspect.Parameter]:
    """Parameters of a function, with their types; a group stands for its fields."""
    hints = get_type_hints(work, include_extras=True)
    for param in inspect.signature(work).parameters.values():
        if is_dataclass(kind := hints[param.name]):
            yield from (own.replace(kind=own.KEYWORD_ONLY) for own in _parameters(kind))
        else:
            yield param.replace(annotation=kind)


def _parameters_of(library: Any, without: set[str]) -> Iterator[inspect.Parameter]:
    """Parameters of the library's function whose defaults are no constants of its module."""
    for param in inspect.signature(library).parameters.values():
        kind = kind_of(param.annotation)
        default = None if kind == list[str] | None else param.default
        if param.name not in without and default is not param.empty:
            yield param.replace(kind=param.KEYWORD_ONLY, annotation=kind, default=default)


def _described(param: inspect.Parameter, helps: dict[str, str]) -> inspect.Parameter:
    """A parameter with what typer wants to know; a switch that is off has no opposite."""
    kind, info = param.annotation, typer.Option()
    if hasattr(kind, "__metadata__"):
        kind, info = kind.__origin__, copy(kind.__metadata__[0])
    if param.kind != param.KEYWORD_ONLY:
        info = typer.Argument()
    elif info.default is ... and param.default is not True:
        info.param_decls = (f"--{param.name.strip('_').replace('_', '-')}",)
    if param.name in options.RANGES:
        info.min, info.max = options.RANGES[param.name]
    info.help = plain(helps[param.name].replace("<names>", completion.choices_text(param.name)))
    info.autocompletion = completion.offered(param.name)
    return param.replace(kind=param.KEYWORD_ONLY, annotation=Annotated[kind, info])


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
