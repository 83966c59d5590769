"""Joint coordinates of the chains."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from .chains import by_unit, readable, styles
from .labels import caption, shown
from .panels import drawn_limits, finish, legend_above, limits, lines
from .registry import plot
from .style import new_figure

if TYPE_CHECKING:
    from ...results.solution import Solution

ROWS = (("joint", "coordinate"), ("joint_rate", "rate"), ("joint_acceleration", "acceleration"))


@plot()
def joint(solution: Solution) -> Figure:
    """Joint coordinates from home, their rates with the limits, and accelerations."""
    names = [str(name) for name in solution["chain"].values]
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
