"""How far actuators or muscles are used, and what the joints carry meanwhile."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..actuators import EMG_ROW, activations, emg, joint_loads
from ..words import stem
from .chains import readable
from .labels import TIME, caption
from .panels import legend, lines
from .registry import plot
from .style import ALERT, GREY, new_figure, nothing_to_draw

if TYPE_CHECKING:
    from ...results.solution import Solution

NO_LIMITS = "no actuator of this mechanism states a limit of its effort"
COLOURS = "YlGnBu"


@plot()
def activation(solution: Solution) -> Figure:
    """Activation, effort over greatest effort, of each actuator or muscle; joint loads below.

    Where EMG was measured (`Solution.with_measured`), its envelope stands under its muscle's row.
    """
    title = "Activation: effort over greatest effort"
    computed, measured, loads = activations(solution), emg(solution), joint_loads(solution)
    found = beneath(computed, measured)
    if not found:
        return nothing_to_draw(title, caption(solution), NO_LIMITS)
    rows = 0.35 + 0.19 * len(found)
    heights = [rows, 1.6] if loads else [rows]
    figure = new_figure(title, caption(solution), 8.0, 1.4 + sum(heights))
    grid = figure.subplots(
        len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    field(grid[0, 0], solution["time"].values, found)
    if loads:
        axes, names = grid[1, 0], list(loads)
        lines(axes, solution, np.array(list(loads.values())).T, list(map(readable, names)))
        legend(axes, min(3, len(names)))
        axes.set(ylabel="joint load [N]")
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    grid[-1, 0].set_xlabel(TIME)
    return figure


def beneath(
    computed: dict[str, np.ndarray], measured: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Rows of what was computed, each with what was measured of it under it."""
    rows = {}
    for name in dict.fromkeys([*computed, *measured]):
        if name in computed:
            rows[name] = computed[name]
        if name in measured:
            rows[f"{name}{EMG_ROW}"] = measured[name]
    return rows


def field(axes: Axes, time: np.ndarray, found: dict[str, np.ndarray]) -> None:
    """Rows of colour from 0 to 1; beyond 1 and without a result they have colours of their own."""
    values = np.array(list(found.values()))
    colours = colormaps[COLOURS].with_extremes(bad="#DDDDDD", over=ALERT)
    drawn = axes.pcolormesh(
        boundaries(time), np.arange(len(found) + 1), np.ma.masked_invalid(values),
        cmap=colours, vmin=0.0, vmax=1.0, rasterized=True,
    )  # fmt: skip
    axes.set_yticks(np.arange(len(found)) + 0.5, list(map(readable, found)), fontsize=7)
    for name, label in zip(found, axes.get_yticklabels(), strict=True):
        if name.endswith(EMG_ROW):
            label.set(style="italic", color=GREY)
    axes.invert_yaxis()
    axes.grid(False)
    # A line between pairs, so that rows can be followed to their names.
    stems = [stem(name.removesuffix(EMG_ROW)) for name in found]
    pairs = [i for i in range(1, len(stems)) if stems[i] != stems[i - 1]]
    for level in pairs:
        axes.axhline(level, color=GREY, lw=0.6)
    over = bool(np.nanmax(values, initial=0.0) > 1.0)
    beside = axes.inset_axes((1.015, 0.0, 0.018, 1.0))  # no panel of its own
    axes.figure.colorbar(drawn, cax=beside, extend="max" if over else "neither")
    axes.set_ylabel("activation [1]")
    if over:
        axes.set_title("orange: beyond the greatest effort")


def boundaries(time: np.ndarray) -> np.ndarray:
    """Where one sample's colour ends and the next begins, (N + 1,) [s]."""
    if len(time) < 2:
        return time[0] + np.array([-0.5, 0.5])
    middle = 0.5 * (time[1:] + time[:-1])
    return np.concatenate([time[:1], middle, time[-1:]])
