"""Axes with lines over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from .labels import TIME
from .style import DARK, GREY, look

if TYPE_CHECKING:
    from ...results.solution import Solution

REACH = 2.5  # a limit beyond this many times the data would flatten them


def lines(
    axes: Axes,
    solution: Solution,
    values: np.ndarray,
    names: Sequence[str],
    styles: Sequence[dict[str, Any]] | None = None,
) -> None:
    """Curves over time, (N, m), one a name; samples without a result are shaded.

    Args: styles: of the lines; by default all differ.
    """
    styles = styles or [look(i) for i in range(len(names))]
    time = solution["time"].values
    for column, name, style in zip(values.T, names, styles, strict=True):
        axes.plot(time, column, label=name, **style)
    if len(time) > 1:
        axes.set_xlim(time[0], time[-1])
    shade_failed(axes, solution)


def shade_failed(axes: Axes, solution: Solution) -> None:
    """Grey where samples are unreachable or singular."""
    failed = np.concatenate([[False], solution["status"].values != 0, [False]])
    time = solution["time"].values
    edges = np.flatnonzero(np.diff(failed.astype(int)))
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        axes.axvspan(time[start], time[end - 1], color=GREY, alpha=0.2, lw=1)


def finish(grid: np.ndarray, y_labels: Sequence[Sequence[str]]) -> None:
    """Label a grid of axes, (rows, columns): time below, the rest at the left of each."""
    for row, row_labels in zip(grid, y_labels, strict=True):
        for axes, label in zip(row, row_labels, strict=True):
            axes.set_ylabel(label)
    grid[0, 0].figure.align_ylabels(grid.ravel())
    for axes in grid[-1]:
        axes.set_xlabel(TIME)
    for axes in grid[:-1].ravel():
        axes.tick_params(labelbottom=False)


def limits(axes: Axes, values: np.ndarray, limit: float, unit: str) -> None:
    """An actuator's limit as lines, or in the title where the data stay far below it."""
    text = f"limit ±{limit:.4g} {unit}"
    peak = float(np.nanmax(np.abs(values), initial=0.0))
    if limit > REACH * peak:
        title = axes.get_title(loc="left")
        axes.set_title(f"{title + ', ' if title else ''}{text} is outside the view")
        return
    for bound in (limit, -limit):
        axes.axhline(bound, color=DARK, lw=1, ls=(0, (6, 3)))
    place = axes.get_yaxis_transform()
    axes.annotate(
        text, (0, limit), (3, 2), xycoords=place, textcoords="offset points", fontsize=7, color=DARK
    )


def same_scale(column: Sequence[Axes]) -> None:
    """Give axes one vertical scale with zero on it, so that their curves can be compared."""
    curves = [np.asarray(line.get_ydata()) for axes in column for line in axes.get_lines()]
    low = min(float(np.nanmin(curve, initial=0.0)) for curve in curves)
    high = max(float(np.nanmax(curve, initial=0.0)) for curve in curves)
    margin = 0.06 * (high - low)
    for axes in column:
        if margin > 0:
            axes.set_ylim(low - margin, high + margin)


def legend_beside(axes: Axes) -> None:
    """A legend to the right of the axes."""
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))


def legend(axes: Axes, columns: int = 1) -> None:
    """A legend above the axes' right end, where no curve runs."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=columns, borderaxespad=0.0)
