"""Joint coordinates of the chains."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .chains import by_unit, groups, heading, readable, short, styles
from .labels import TIME, caption, shown
from .panels import drawn_limits, finish, legend_above, limits, lines, same_scale
from .registry import plot
from .style import DARK, new_figure

if TYPE_CHECKING:
    from ...results.solution import Solution

ROWS = (("joint", "coordinate"), ("joint_rate", "rate"), ("joint_acceleration", "acceleration"))
ORDER = ("first named", "second named")
NAME = 16  # letters of a line
MOST = 8  # chains in one panel; beyond, no curve can be followed


@plot()
def joint(solution: Solution) -> Figure:
    """Joint coordinates from home, their rates with the limits, and accelerations."""
    names = [str(name) for name in solution["chain"].values]
    if len(names) > MOST:
        return small_multiples(solution, names)
    columns = by_unit([str(unit) for unit in solution["joint_unit"].values])
    figure = new_figure("Joint coordinates", caption(solution), 1.5 + 5.5 * len(columns), 7.2)
    grid = figure.subplots(3, len(columns), sharex=True, squeeze=False)
    looks, bounds = styles(names), drawn_limits(solution, "joint_rate")
    labels = []
    for order, (row, (variable, kind)) in enumerate(zip(grid, ROWS, strict=True)):
        row_labels = []
        for axes, (si_unit, members) in zip(row, columns.items(), strict=True):
            unit, factor = shown(si_unit, order)
            values = solution[variable].values[:, members] * factor
            own = [names[i] for i in members]
            lines(axes, solution, values, list(map(readable, own)), [looks[i] for i in members])
            if order == 1:
                limits(axes, values, bounds, own, unit, factor)
            row_labels.append(f"{kind} [{unit}]")
        labels.append(row_labels)
    finish(grid, labels)
    legend_above(figure, grid[0])
    return figure


def small_multiples(solution: Solution, names: list[str]) -> Figure:
    """A row for each pair of chains, with one scale in a column for those of one unit."""
    units = [str(unit) for unit in solution["joint_unit"].values]
    rows = groups(names, units)
    figure = new_figure("Joint coordinates", caption(solution), 8.5, 1.4 + 0.62 * len(rows), 3)
    grid = figure.subplots(len(rows), 3, sharex=True, squeeze=False)
    sides = [short([names[i] for i in members]) for members in rows]
    paired = all(one == sides[0] for one in sides)
    for row, members, own in zip(grid, rows, sides, strict=True):
        labels = own if paired else ORDER[: len(own)]
        for order, (axes, (variable, kind)) in enumerate(zip(row, ROWS, strict=True)):
            unit, factor = shown(units[members[0]], order)
            lines(axes, solution, solution[variable].values[:, members] * factor, labels)
            if axes in grid[0]:
                axes.set_title(f"{kind} [{unit}]" if len({*units}) == 1 else kind, pad=8)
        named = fill(heading([names[i] for i in members]), NAME)
        unit = "" if len({*units}) == 1 else f" [{shown(units[members[0]])[0]}]"
        row[0].set_ylabel(named + unit, rotation=0, ha="right", va="center", fontsize=7)
    for unit in dict.fromkeys(units):
        mine = [k for k, members in enumerate(rows) if units[members[0]] == unit]
        for column in grid.T:
            same_scale([column[k] for k in mine])
    draw_rate_limits(solution, rows, names, units, grid[:, 1])
    for axes in grid.ravel():
        axes.tick_params(labelsize=6, labelbottom=axes in grid[-1])
        axes.yaxis.set_major_locator(MaxNLocator(3))
    for axes in grid[-1]:
        axes.set_xlabel(TIME)
    legend_above(figure, grid[0])
    return figure


def draw_rate_limits(
    solution: Solution,
    rows: list[list[int]],
    names: list[str],
    units: list[str],
    column: np.ndarray,
) -> None:
    """Limits of the joint rates, in the panels whose scale reaches so far."""
    bounds = drawn_limits(solution, "joint_rate")
    for axes, members in zip(column, rows, strict=True):
        factor = shown(units[members[0]], 1)[1]
        low, high = axes.get_ylim()
        for level in {
            v * factor for i in members for v in (bounds[names[i]].low, bounds[names[i]].high)
        }:
            if low <= level <= high:
                axes.axhline(level, color=DARK, lw=0.8, ls=(0, (6, 3)))
