"""condyle design: the numbers of a mechanism's file that make a motion cheapest."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import output_folder, require_drawing


@command(COMPUTE, example="condyle design study.toml --out better")
def design(
    study: Annotated[Path, typer.Argument(help="Design study (TOML).")],
    out: Path | None = None,
    figures: bool = False,
) -> Answer:
    """The numbers of a mechanism that make a motion cheapest, within limits.

    A study names the numbers and their ranges, what is minimised, and limits of measures; exact
    slopes lead to the best near the mechanism's own numbers, and near other starts.

    Options:
        out: Folder for the mechanism's file and tables. Default: the name of the study.
        figures: Also draw efforts before and after, and the Pareto front, into the folder.
    """
    require_drawing(figures, False)
    import condyle

    folder = output_folder(out or Path(study.stem))
    found = condyle.design(study)
    files = found.save(folder)
    if figures:
        from ..report.figures import save
        from ..report.figures.design_figures import design_figure

        files += save(design_figure(found), folder, "design")
    text = f"{found}\n{files_line(files)}"
    return Answer(text, {**found.data, "files": files}, command_line("check", files[0]))
