"""condyle plot: figures of a solution."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError, did_you_mean
from ..extras import require
from .answer import Answer, command_line
from .command import INSPECT, command
from .inputs import output_folder

RESULT = Path("results/masticatory.nc")  # of `condyle run` as it stands


@command(INSPECT, example=f"condyle plot {RESULT} --figure effort --figure load")
def plot(
    solution: Annotated[
        Path | None, typer.Argument(help="Results (.nc) of a run. Without it: list the figures.")
    ] = None,
    figure: list[str] | None = None,
    out: Path = Path("figures"),
    style: str = "screen",
    title: bool = True,
    letters: bool = False,
) -> Answer:
    """Figures of a run, for screen or print.

    Options:
        figure: Figure to draw; repeat for more. Default: all.
        out: Folder for PNG and SVG files.
        style: screen; journal (85 mm wide, 8 pt font); or journal-wide (175 mm).
        title: Draw title and source of the data.
        letters: Label panels (a), (b) ...
    """
    require("matplotlib", "figures")
    import condyle

    from ..report.figures import PLOTS, plots_of, save_each

    for name in figure or ():
        if name not in PLOTS:
            raise InputError(f'no figure "{name}".{did_you_mean(name, PLOTS)}')
    if solution is None:
        shows = {name: (draw.__doc__ or "").strip().splitlines()[0] for name, draw in PLOTS.items()}
        text = "\n".join(f"{name:<14} {what}" for name, what in shows.items())
        then = command_line("plot", RESULT) if RESULT.is_file() else "condyle run --figures"
        return Answer(text, {"figures": shows}, then, "result")
    data = condyle.open_solution(solution)
    wishes = {"style": style, "title": title, "letters": letters}
    plots = {name: partial(PLOTS[name], **wishes) for name in figure or plots_of(data)}
    files = save_each(plots, data, output_folder(out))
    text = "\n".join(f"Wrote {path}" for path in files)
    return Answer(text, {"files": files}, command_line("report", solution))
