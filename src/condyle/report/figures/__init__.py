"""Figures of a solution, in one house style; among them Figures 5 to 9 of the paper.

from condyle.report.figures import PLOTS
PLOTS["effort"](solution).savefig("effort.png")
"""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ...files.atomic import file_stem
from . import forces_figure as _forces_figure
from . import modes_figure as _modes_figure
from . import movement_figure as _movement_figure
from .drawing import figure_of
from .paper_figures import figure_5, figure_8, figure_9
from .registry import PLOTS, find_figures, plot, solution_plots
from .saving import FORMATS, save, save_drawn

if TYPE_CHECKING:
    import xarray as xr

    from ...analysis.comparison import Comparison

find_figures(figure_of)

__all__ = [
    "PLOTS",
    "_forces_figure",
    "_modes_figure",
    "_movement_figure",
    "plot",
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
        "figure-9-share": figure_9,
    }
    drawn = {name: partial(draw, solution) for name, draw in figures.items()}
    drawn["figure-8-torque"] = partial(figure_8, comparison)
    return save_drawn(dict(sorted(drawn.items())), folder)


def save_solution_figures(solution: xr.Dataset, folder: str | os.PathLike[str]) -> list[Path]:
    """Write the plots of `PLOTS` as PNG and SVG into a folder that exists; returns the paths.

    <mechanism>-effort.png, <mechanism>-effort.svg, ... Plots without data in the solution are
    omitted, such as of contacts or of activations; their files of an earlier solution are removed.
    """
    stem = file_stem(solution.attrs["mechanism_name"])
    plots = {f"{stem}-{name}": partial(draw, solution) for name, draw in PLOTS.items()}
    paths = save_drawn(plots, folder)
    for stale in {Path(folder) / f"{name}.{kind}" for name in plots for kind in FORMATS} - {*paths}:
        stale.unlink(missing_ok=True)
    return paths
