"""condyle new: a first mechanism or study file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..analysis.studies import STUDIES
from ..errors import UnsupportedError
from .answer import Answer, command_line
from .command import START, command
from .completion import bundled, one_of, study_names
from .inputs import STRICT, warn
from .options import option

KINDS = ", ".join(STUDIES)


@command(START, example="condyle new my-robot --from gough-stewart")
def new(
    name: Annotated[
        str | None, typer.Argument(help="Name of the mechanism or study; the file is NAME.toml.")
    ] = None,
    from_bundled: Annotated[
        str | None, option("", "--from", autocompletion=one_of(*bundled()))
    ] = None,
    from_mjcf: Path | None = None,
    study: Annotated[
        str | None,
        option(f"Write a study file of this kind instead: {KINDS}.", autocompletion=study_names),
    ] = None,
    list_all: Annotated[bool, option("", "--list")] = False,
    force: bool = False,
) -> Answer:
    """Mechanism file to start from, or study file.

    A small mechanism that works, with a comment on every number, to change step by step; or, with
    --from, the commented file of a bundled mechanism; or, with --from-mjcf, a MuJoCo model; or,
    with --study, a commented file of that kind.

    Options:
        from_bundled: Copy the file of this bundled mechanism, by its name or a word of it:
            gough-stewart, hexaglide, cable, jaw; --list shows all.
        from_mjcf: Convert this MuJoCo model (MJCF), if a mechanism file has its kinds of chains and
            contacts.
        list_all: Show the bundled mechanisms and the kinds of study files, a line each.
        force: Replace an existing file.
    """
    import condyle

    sources = {"--from": from_bundled, "--from-mjcf": from_mjcf, "--study": study}
    given = [option for option, value in sources.items() if value is not None]
    if list_all:
        if name is not None or given:
            raise UnsupportedError("--list writes no file: leave the name and other options out")
        return _listed()
    if name is None:
        raise UnsupportedError("condyle new needs a name; the file is NAME.toml. Or take --list")
    if len(given) > 1:
        raise UnsupportedError(f"{' and '.join(given)} each say what to write; take one")
    if study is not None:
        path = condyle.new_study(name, study, force=force)
        return Answer(f"Wrote {path}", {"files": [path]}, command_line("schema", study))

    made = condyle.new_mechanism(
        name, from_bundled=from_bundled, from_mjcf=from_mjcf, force=force, strict=STRICT.get()
    )
    warn(made.warnings)
    return Answer(f"Wrote {made.path}", {"files": [made.path]}, command_line("check", made.path))


def _listed() -> Answer:
    from ..analysis.new_study import study_lines
    from ..export.new_mechanism import mechanism_lines

    tables = {"mechanisms": mechanism_lines(), "studies": study_lines()}
    width = max(len(name) for lines in tables.values() for name in lines)
    text = []
    for title, lines in zip(("--from", "--study"), tables.values(), strict=True):
        text += [title, *(f"  {name:<{width}}  {line}" for name, line in lines.items())]
    then = command_line("new", "my-robot", **{"from": "gough-stewart"})
    return Answer("\n".join(text), tables, then, kind="result")
