"""What commands do with their options: folders, files of results, what is not installed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import condyle

from ..errors import MissingExtraError
from ..extras import require
from ..files.atomic import file_stem
from .answer import Answer, command_line, files_line, warn
from .options import OutputOptions, output_folder

if TYPE_CHECKING:
    import xarray as xr


def solved(
    solution: xr.Dataset,
    output: OutputOptions,
    inputs: Iterable[str | Path | None],
    lines: Iterable[str],
    data: Mapping[str, Any],
    log: Callable[[], list[Path]] = list,
) -> Answer:
    """The answer of a solution: its warnings, the files that are asked for, its summary.

    Args: inputs: files of the run, to be named in the report.
          lines, data: what else is known;  log: writes further files.
    """
    from ..results.summary import summarize

    warn(solution.condyle.warnings)
    folder, stem = output_folder(output.out), file_stem(solution.attrs["mechanism_name"])
    files = [folder / f"{stem}{ending}" for ending in (".nc", ".csv", *[".mat"] * output.mat)]
    solution.condyle.save(*files)
    then = command_line("report", files[0])
    if output.figures:
        from ..report.figures import save_solution_figures

        files += save_solution_figures(solution, folder)
    if output.report:
        named = [Path(file) for file in inputs if file is not None and Path(file).is_file()]
        files.append(condyle.write_report(solution, folder / f"{stem}.html", files=named))
        then = command_line("view", solution=files[0])  # the page is there already
    files += log()
    summary = summarize(solution)
    text = "\n".join([str(summary), *lines, "", files_line(files)])
    return Answer(text, {**summary.data, **data, "files": files}, then)


def drawn(plots: Any, stem: Path, *arguments: Any) -> list[Path]:
    """Save all figures of an accessor of plots, each as STEM-NAME."""
    from ..report.figures.saving import save_drawn

    named = {f"{stem.name}-{name}": partial(getattr(plots, name), *arguments) for name in plots}
    return save_drawn(named, stem.parent)


def require_drawing(figures: bool, report: bool) -> None:
    """Raises MissingExtraError before minutes pass, if what draws them is not installed."""
    if figures:
        require("matplotlib", "figures")
    if report:
        require("plotly", "report")


def can_draw(figures: bool) -> bool:
    """Whether figures that a command draws by default are drawn; a warning where they cannot be."""
    try:
        require_drawing(figures, False)
    except MissingExtraError as error:
        warn([f"no figures are drawn: {error}"])
        return False
    return figures
