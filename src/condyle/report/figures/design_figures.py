"""What a design is better by: the cost over time before and after, numbers, the front."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .style import ALERT, DARK, GREY, PALETTE, house, labelled, new_figure

if TYPE_CHECKING:
    from ...analysis.design import Designed


@house
def design_figure(designed: Designed) -> Figure:
    """The largest of what the cost is of over time, numbers between their ends, the front."""
    p, front = designed.problem, designed.front
    cost = p.study.cost[0]
    caption = f"Mechanism {designed.mechanism.name}; {len(designed.ends)} starts."
    figure = new_figure(f"Design: {cost}", caption, 10.5 if front else 8.0, 3.8)
    axes = figure.subplots(1, 3 if front else 2)
    readings = p.job.readings
    index = next(i for i, entry in enumerate(readings) if p.study.cost[0] in entry.names)
    reading = readings[index]
    time = np.concatenate([motion.t for motion in p.job.motions])
    points = ((designed.first, GREY, "before"), (designed.best.point, PALETTE[0], "after"))
    for point, colour, label in points:
        if point.good:
            each = np.abs(point.entries[index]).reshape(len(time), -1).max(axis=1)
            axes[0].plot(time, each, color=colour, label=label, lw=1.2)
    axes[0].set(xlabel="t [s]", ylabel=labelled(f"largest {reading.variable}", reading.units))
    axes[0].legend()
    place = (designed.best.point.x - p.low) / (p.high - p.low)
    was = (p.base - p.low) / (p.high - p.low)
    rows = np.arange(len(place))
    axes[1].hlines(rows, 0, 1, color=GREY, lw=0.5)
    axes[1].plot(was, rows, "o", color=GREY, markersize=4)
    axes[1].plot(place, rows, "o", color=PALETTE[0], markersize=4)
    axes[1].set(xlabel="between its ends", xlim=(-0.03, 1.03), ylim=(len(rows) - 0.5, -0.5))
    names = [number.what.removeprefix("chain.") for number in p.study.vary]
    axes[1].set_yticks(rows, names, fontsize=6)
    if front and p.study.pareto is not None:
        other = p.column(p.study.pareto.measure)
        values = np.array([result.point.measures for result in front])
        good = np.array([result.feasible for result in front])
        axes[2].plot(values[good, other], values[good, p.cost.column], "o-", color=PALETTE[0])
        axes[2].plot(values[~good, other], values[~good, p.cost.column], "x", color=ALERT)
        first = designed.first.measures
        axes[2].plot(first[other], first[p.cost.column], "s", color=DARK, label="before")
        axes[2].set(xlabel=p.job.measures[other], ylabel=cost)
        axes[2].margins(0.06)
        axes[2].legend()
    return figure


FIGURES = {"Before and after": design_figure}
