"""Figures of a solution, in one house style; among them Figures 5 to 9 of the paper.

from condyle.report.figures import PLOTS
PLOTS["effort"](solution).savefig("effort.png")
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from ...files.atomic import file_stem
from ..panel import PANEL_GROUPS
from . import forces_figure as _forces_figure
from . import movement_figure as _movement_figure
from .drawing import figure_of
from .paper_figures import figure_5, figure_8, figure_9
from .registry import PLOTS, find_figures, plot, plots_of, solution_plots
from .saving import FORMATS, save, save_drawn

if TYPE_CHECKING:
    import xarray as xr

    from ...analysis.comparison import Comparison

find_figures(figure_of)

__all__ = [
    "PLOTS",
    "_forces_figure",
    "_movement_figure",
    "plot",
    "plots_of",
    "save",
    "save_figures",
    "save_solution_figures",
    "solution_plots",
]


def save_figures(
    solution: xr.Dataset, comparison: Comparison, folder: str | os.PathLike[str]
) -> list[Path]:
    """Write Figures 5 to 9 of the paper as PNG and SVG into a folder that exists.

    Returns: the paths: figure-5-motion.png, figure-5-motion.svg, ...
    """
    figures = {
        "figure-5-motion": figure_5,
        "figure-6-jacobian": PLOTS["jacobian"],
        "figure-7-load": PLOTS["load"],
        "figure-8-torque": lambda _: figure_8(comparison),
        "figure-9-share": figure_9,
    }
    return save_drawn(figures, solution, folder)


def save_solution_figures(solution: xr.Dataset, folder: str | os.PathLike[str]) -> list[Path]:
    """Write the plots of `PLOTS` as PNG and SVG into a folder that exists; returns the paths.

    <mechanism>-effort.png, <mechanism>-effort.svg, ... Plots without data in the solution are
    omitted, such as of contacts or of activations; their files of an earlier solution are removed.
    """
    stem = file_stem(solution.attrs["mechanism_name"])
    plots, none = {}, set()
    drawn = plots_of(solution)
    for name, draw in PLOTS.items():
        if name in drawn and (name not in PANEL_GROUPS or any(PANEL_GROUPS[name].panels(solution))):
            plots[f"{stem}-{name}"] = draw
        else:
            none |= {Path(folder) / f"{stem}-{name}.{kind}" for kind in FORMATS}
    paths = save_drawn(plots, solution, folder)
    for stale in none:
        stale.unlink(missing_ok=True)
    return paths
