"""Efforts of the actuators (the paper's Fig. 8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .chains import by_unit, groups, heading, readable, short
from .labels import caption
from .panels import (
    bands_of,
    drawn_limits,
    finish,
    finish_grid,
    legend,
    legend_beside,
    limits,
    lines,
    same_scale,
)
from .registry import plot
from .style import house, narrow, new_figure

if TYPE_CHECKING:
    from ...analysis.comparison import Comparison
    from ...analysis.runs import Run
    from ...results.solution import Solution

MOST_ROWS = 6  # of panels one above the other


@plot()
def torque(solution: Solution) -> Figure:
    """Effort of each chain over time, with its actuator's limit."""
    names, units = chains_of(solution)
    panels = groups(names, units)
    many = len(panels) > MOST_ROWS and not narrow()
    columns = 2 if many else 1
    rows = -(-len(panels) // columns)
    width, height = (12.0, 1.45) if many else (7.5, 1.7)
    figure = new_figure("Efforts of the actuators", caption(solution), width, 0.9 + height * rows)
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    bounds = drawn_limits(solution, "torque")
    values = solution["torque"].values
    used = list(grid.ravel())[: len(panels)]
    for axes, members in zip(used, panels, strict=True):
        own = [names[i] for i in members]
        labels = short(own) if many else list(map(readable, own))
        bands = bands_of(solution, "torque", members)
        lines(axes, solution, values[:, members], labels, bands=bands)
        legend(axes, 2)
        axes.set_title(heading(own))
        unit = units[members[0]]
        limits(axes, values[:, by_unit(units)[unit]], bounds, own, unit)
        axes.set_ylabel(effort_label(unit))
    scale_by_unit(np.array(used)[:, None], panels, units)
    finish_grid(grid, len(panels))
    return figure


@house
def figure_8(comparison: Comparison) -> Figure:
    """The paper's Fig. 8: torques of Model 1, and how far other models are from them."""
    solution = comparison.solution
    names, units = chains_of(solution)
    panels = groups(names, units)
    first, others = first_and_others(comparison)
    columns = [(first.label, first.torque)]
    columns += [(f"{first.label} − {other.label}", first.torque - other.torque) for other in others]
    figure = new_figure(
        f"Efforts by {first.label}, and differences to other models",
        caption(solution),
        1.2 + 3.4 * len(columns),
        1.1 + 1.7 * len(panels),
        len(columns),
    )
    grid = figure.subplots(len(panels), len(columns), sharex=True, squeeze=False)
    for row, members in zip(grid, panels, strict=True):
        own = [readable(names[i]) for i in members]
        for axes, (_, values) in zip(row, columns, strict=True):
            lines(axes, solution, values[:, members], own)
        legend_beside(row[-1])
    for axes, (title, _) in zip(grid[0], columns, strict=True):
        axes.set_title(title, pad=20)
    scale_by_unit(grid, panels, units)
    finish(grid, [[effort_label(units[m[0]])] + [""] * len(others) for m in panels])
    return figure


def first_and_others(comparison: Comparison) -> tuple[Run, list[Run]]:
    """Model 1 (momentum, direct) and the two the paper sets against it, as far as there are."""
    wanted = [
        ("momentum", "direct"),
        ("momentum", "core"),
        ("lagrange", "direct"),
        ("lagrange", "core"),
    ]
    found = [run for key in wanted if (run := comparison.run(*key)) is not None]
    found += [run for run in comparison.runs if run not in found]
    return found[0], found[1:3]


def chains_of(solution: Solution) -> tuple[list[str], list[str]]:
    """Names of the chains and units of their efforts."""
    names = [str(name) for name in solution["chain"].values]
    return names, [str(unit) for unit in solution["effort_unit"].values]


def effort_label(unit: str) -> str:
    """The label of an axis of efforts."""
    return f"{'force' if unit == 'N' else 'torque'} [{unit}]"


def scale_by_unit(grid: np.ndarray, panels: list[list[int]], units: list[str]) -> None:
    """One vertical scale in a column for the panels of one unit."""
    for unit in set(units):
        rows = [k for k, members in enumerate(panels) if units[members[0]] == unit]
        for column in grid.T:
            same_scale([column[k] for k in rows])
