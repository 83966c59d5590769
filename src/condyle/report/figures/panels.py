"""Axes with lines over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...mechanism.chain import limits as actuator_limits
from ..actuators import REACH
from ..failures import failures, longest
from .chains import readable
from .labels import TIME
from .style import DARK, GREY, look, narrow

if TYPE_CHECKING:
    from ...mechanism.actuator import Limits
    from ...results.solution import Solution

NO_RESULT = "no result"


def lines(
    axes: Axes,
    solution: Solution,
    values: np.ndarray,
    names: Sequence[str],
    styles: Sequence[dict[str, Any]] | None = None,
    bands: np.ndarray | None = None,
) -> None:
    """Curves over time, (N, m), one a name; samples without a result are shaded.

    Args: styles: of the lines; by default all differ.
          bands: quantiles over variants, (Q, N, m), from the least; the outer ones are paler.
    """
    styles = styles or [look(i) for i in range(len(names))]
    time = solution["time"].values
    for column, name, style in zip(values.T, names, styles, strict=True):
        axes.plot(time, column, label=name, **style)
    for quantiles, style in zip(() if bands is None else bands.T, styles, strict=False):
        for i in range(quantiles.shape[1] // 2):
            low, high = quantiles[:, i], quantiles[:, -1 - i]
            axes.fill_between(time, low, high, color=style["color"], alpha=0.18, lw=0)
    if len(time) > 1:
        axes.set_xlim(time[0], time[-1])
    shade_failed(axes, solution)


def bands_of(solution: Solution, variable: str, members: Sequence[int]) -> np.ndarray | None:
    """Quantiles of a variable, (Q, N, len(members)), where the solution has them."""
    name = f"{variable}_quantile"
    return solution[name].values[..., list(members)] if name in solution else None


def shade_failed(axes: Axes, solution: Solution) -> None:
    """Grey where samples have no result; the legend says so."""
    for i, one in enumerate(longest(failures(solution))):
        label = NO_RESULT if i == 0 else None
        axes.axvspan(one.start, one.end, color=GREY, alpha=0.2, lw=1, label=label)


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


def finish_grid(grid: np.ndarray, count: int) -> None:
    """Label time below the last panel of each column of a grid with `count` panels, row by row."""
    for k, axes in enumerate(grid.ravel()):
        if k >= count:
            axes.remove()
        elif k + grid.shape[1] >= count:
            axes.set_xlabel(TIME)
            axes.tick_params(labelbottom=True)
        else:
            axes.tick_params(labelbottom=False)
    grid[0, 0].figure.align_ylabels(list(grid.ravel()[:count]))


def drawn_limits(solution: Solution, variable: str) -> dict[str, Limits]:
    """Chain -> limits of its torque or force, or of its speed, as those of an effort."""
    found = {chain.name: actuator_limits(chain) for chain in solution.mechanism.chains}
    if variable == "torque":
        return found
    return {name: one.of_speed for name, one in found.items()}


def limits(
    axes: Axes,
    values: np.ndarray,
    bounds: Mapping[str, Limits],
    names: Sequence[str],
    unit: str,
    factor: float = 1.0,
) -> None:
    """Limits of the actuators `names` as lines, or in the title where the data stay far below.

    Args: bounds: limits by name;  factor: from their unit to that of the axis.
    """
    pairs = {name: (bounds[name].low, bounds[name].high) for name in names if bounds[name].limited}
    for pair in dict.fromkeys(pairs.values()):
        own = [name for name in names if pairs.get(name) == pair]
        who = "" if len(own) == len(names) else f" ({', '.join(map(readable, own))})"
        text = bounds[own[0]].effort_text(unit, factor, 4)
        draw_limit(axes, values, (pair[0] * factor, pair[1] * factor), f"limit {text}{who}")


def draw_limit(axes: Axes, values: np.ndarray, bounds: tuple[float, float], text: str) -> None:
    """One limit, at its levels; one at 0 is the axis."""
    peak = float(np.nanmax(np.abs(values), initial=0.0))
    levels = [level for level in reversed(bounds) if level and np.isfinite(level)]
    if levels and min(map(abs, levels)) > REACH * peak:
        title = axes.get_title(loc="left")
        axes.set_title(f"{title + ', ' if title else ''}{text} is outside the view")
        return
    for level in levels:
        axes.axhline(level, color=DARK, lw=1, ls=(0, (6, 3)))
    place, at = axes.get_yaxis_transform(), max(levels, default=0.0)
    axes.annotate(
        text, (0, at), (3, 2), xycoords=place, textcoords="offset points", fontsize=7, color=DARK
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
    """A legend to the right of the axes, above them where there is no room."""
    if narrow():
        legend(axes, 2)
        return
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))


def legend(axes: Axes, columns: int = 1) -> None:
    """A legend above the axes' right end, where no curve runs."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=columns, borderaxespad=0.0)


def legend_above(figure: Figure, panels: Iterable[Axes], columns: int = 3) -> None:
    """One legend between the heading and all panels, each label once."""
    entries: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        entries |= dict(zip(labels, handles, strict=True))
    columns = 2 if narrow() else columns
    rows = -(-len(entries) // columns)
    # The heading keeps the room: blank lines below it.
    heading, small = mpl.rcParams["figure.titlesize"], mpl.rcParams["legend.fontsize"]
    title = figure.get_suptitle()
    blank = -(-int(rows * 2.0 * small) // int(1.2 * heading))
    figure.suptitle(title + "\n" * blank, x=0.01, ha="left")
    below = 1.9 * heading if title else 0.0
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="upper left",
        bbox_to_anchor=(0.0, 1.0 - below / (72 * figure.get_figheight())),
        ncols=columns,
    )
