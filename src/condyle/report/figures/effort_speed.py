"""Efforts against speeds: what a motor has to be able to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...mechanism.chain import limits as actuator_limits
from ..actuators import duty, edges, limits_text
from .chains import groups, heading, short
from .labels import caption
from .registry import plot
from .style import DARK, look, narrow, new_figure
from .torque import chains_of, effort_label

if TYPE_CHECKING:
    from ...mechanism.actuator import Limits
    from ...results.solution import Solution

MOST_COLUMNS = 4


@plot()
def effort_speed(solution: Solution) -> Figure:
    """Effort of each actuator against its speed, in the box of its limits; rms and peak power."""
    names, units = chains_of(solution)
    panels = groups(names, units)
    columns = 1 if narrow() else min(MOST_COLUMNS, max(2, int(np.ceil(np.sqrt(len(panels))))))
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    title = "Efforts against speeds, with limits"
    figure = new_figure(title, caption(solution), 0.6 + 3.1 * columns, 0.9 + 2.5 * rows)
    grid = figure.subplots(rows, columns, squeeze=False)
    boxes = [actuator_limits(chain) for chain in solution.mechanism.chains]
    duties, speed_units = duty(solution), solution["joint_unit"].values
    place = "lower right" if narrow() else "lower left"
    for axes, members in zip(grid.ravel(), panels, strict=False):
        unit, speed_unit = units[members[0]], f"{speed_units[members[0]]}/s"
        own = [names[i] for i in members]
        within = list(dict.fromkeys(boxes[i] for i in members))
        labels = [f"{name}: {duties[i].text}" for name, i in zip(short(own), members, strict=True)]
        draw_plane(axes, solution, members, within, labels)
        told = [limits_text(box, unit, speed_unit) or "none" for box in within]
        axes.legend(
            title=f"limits: {'; '.join(told)}", loc=place,
            bbox_to_anchor=(0.0, 1.0),
            borderaxespad=0.0, borderpad=0.2, alignment="left", title_fontsize="small",
        )  # fmt: skip
        axes.set_title(heading(own), pad=13 * (1 + len(own)))
        axes.set(xlabel=f"speed [{speed_unit}]", ylabel=effort_label(unit))
    for axes in grid.ravel()[len(panels) :]:
        axes.remove()
    return figure


def draw_plane(
    axes: Axes, solution: Solution, members: list[int], boxes: list[Limits], labels: list[str]
) -> None:
    """Tracks of some chains, and their boxes as far as they are near the data."""
    speeds, efforts = (solution[v].values[:, members] for v in ("joint_rate", "torque"))
    for i, label in enumerate(labels):
        axes.plot(speeds[:, i], efforts[:, i], label=label, **look(i))
    peaks = [float(np.nanmax(np.abs(values), initial=0.0)) for values in (speeds, efforts)]
    for box in boxes:
        for xs, ys in edges(box, *peaks):
            axes.plot(xs, ys, color=DARK, lw=1, ls=(0, (6, 3)))
    axes.margins(0.06)
    axes.locator_params(nbins=5)
