"""Joint coordinates of the chains."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from .chains import by_unit, readable, styles
from .labels import caption, shown
from .panels import finish, legend_above, limits, lines
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
    looks, bounds = styles(names), speed_limits(solution)
    labels = []
    for order, (row, (variable, kind)) in enumerate(zip(grid, ROWS, strict=True)):
        row_labels = []
        for axes, (si_unit, members) in zip(row, columns.items(), strict=True):
            unit, factor = shown(si_unit, order)
            values = solution[variable].values[:, members] * factor
            own = [names[i] for i in members]
            lines(axes, solution, values, list(map(readable, own)), [looks[i] for i in members])
            if order == 1:
                shown_bounds = {name: limit * factor for name, limit in bounds.items()}
                limits(axes, values, shown_bounds, own, unit)
            row_labels.append(f"{kind} [{unit}]")
        labels.append(row_labels)
    finish(grid, labels)
    legend_above(figure, grid[0])
    return figure


def speed_limits(solution: Solution) -> dict[str, float]:
    """Chain -> its actuator's largest speed, where it has one."""
    limits = {chain.name: chain.actuator.speed_limit for chain in solution.mechanism.chains}
    return {name: limit for name, limit in limits.items() if limit is not None}
