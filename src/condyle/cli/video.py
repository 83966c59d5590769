"""condyle video: a film of a solution."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import options
from .answer import Answer, command_line, files_line
from .command import INSPECT, command


@command(INSPECT, example="condyle video results/masticatory.nc --out chewing.gif")
def video(
    solution: Annotated[Path, typer.Argument(help="Results (.nc) of a run.")],
    out: Path,
    speed: Annotated[float, options.option(min=1e-6, max=1e6)] = 1.0,
    fps: Annotated[float, options.option(min=1, max=60)] = 25.0,
    width: Annotated[int, options.option(min=160, max=1920)] = 640,
    view: str = "Oblique",
) -> Answer:
    """Film of a run: the moving mechanism and its load.

    Options:
        out: File of the film: .gif, or .mp4 (extra video).
        speed: Seconds of the run in a second of the film.
        fps: Frames a second.
        width: Pixels.
        view: Front, Side, Top or Oblique.
    """
    import condyle

    condyle.video(solution, out, speed=speed, fps=fps, width=width, view=view)
    then = command_line("report", solution)
    return Answer(files_line([out]), {"files": [str(out)]}, then)
