"""What a sweep tells, in pictures: scatter, main effects, parallel coordinates, the front."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ...analysis.sweep.effects import directions, good, main_effects, pareto
from .registry import Plots
from .style import ALERT, DARK, GREY, PALETTE, EmptyFigureError, house, labelled, new_figure

if TYPE_CHECKING:
    import xarray as xr

NOTHING_GOOD = "no variant of this sweep has a result"
MOST_POINTS, MOST_LINES = 20_000, 2_000  # that are drawn; more would be one blot
MOST_PANELS = 5  # parameters or measures in one picture


@house
def sweep_scatter(table: xr.Dataset) -> Figure:
    """Every measure over every parameter, a point for each variant."""
    rows = _thinned(good(table), MOST_POINTS)
    measures, parameters = _names(table)
    if not rows.sizes["row"]:
        raise EmptyFigureError(NOTHING_GOOD)
    figure, grid = _grid("Measures over parameters", table, measures, parameters)
    size = float(np.clip(2000 / rows.sizes["row"], 1.0, 12.0))
    look: Any = {"s": size, "lw": 0, "alpha": 0.6, "color": PALETTE[0], "rasterized": True}
    for line, measure in zip(grid, measures, strict=True):
        for axes, parameter in zip(line, parameters, strict=True):
            axes.scatter(rows[parameter], rows[measure], **look)
    return figure


@house
def sweep_effects(table: xr.Dataset) -> Figure:
    """Mean of every measure over every parameter, all else as it comes."""
    effects = main_effects(table)
    measures, parameters = _names(table)
    measures = [m for m in measures if any(effect.measure == m for effect in effects)]
    if not measures:
        raise EmptyFigureError(NOTHING_GOOD)
    figure, grid = _grid("Main effects", table, measures, parameters)
    by_pair = {(effect.measure, effect.parameter): effect for effect in effects}
    for line, measure in zip(grid, measures, strict=True):
        for axes, parameter in zip(line, parameters, strict=True):
            effect = by_pair[measure, parameter]
            axes.plot(effect.place, effect.mean, marker="o", markersize=3, color=PALETTE[0])
            share = "" if np.isnan(effect.share) else f"{effect.share:.0%} of the variance"
            axes.set_title(share, fontweight="normal")
    return figure


@house
def sweep_parallel(table: xr.Dataset) -> Figure:
    """Parallel coordinates: a line for each variant, coloured by the first measure."""
    rows = _thinned(good(table), MOST_LINES)
    measures, parameters = _names(table)
    names = [*parameters, *(m for m in measures if np.isfinite(rows[m].values).all())]
    if not rows.sizes["row"] or len(names) < 2:
        raise EmptyFigureError(NOTHING_GOOD)
    title = "Parameters and measures of each variant"
    figure = new_figure(title, sweep_caption(table), 1.5 + 1.6 * len(names), 4.2)
    axes = figure.subplots()
    values = np.column_stack([rows[name].values for name in names])
    low, high = values.min(axis=0), values.max(axis=0)
    scaled = (values - low) / np.where(high > low, high - low, 1.0)
    places = [float(i) for i in range(len(names))]
    coloured = scaled[:, len(parameters)] if len(names) > len(parameters) else scaled[:, 0]
    order = np.argsort(coloured, kind="stable")
    lines = [np.column_stack([places, scaled[i]]) for i in order]
    drawn = LineCollection(lines, linewidths=0.7, alpha=0.5, cmap="viridis", rasterized=True)
    drawn.set_array(coloured[order])
    axes.add_collection(drawn)
    for place, bottom, top in zip(places, low, high, strict=True):
        axes.axvline(place, color=DARK, lw=0.8)
        for value, y, side in ((bottom, -0.02, "top"), (top, 1.02, "bottom")):
            axes.text(place, y, f"{value:.4g}", ha="center", va=side, fontsize=7)
    axes.set(xlim=(-0.3, len(names) - 0.7), ylim=(-0.1, 1.1), yticks=[])
    axes.set_xticks(places, [_short(name) for name in names])
    axes.grid(False)
    return figure


@house
def sweep_front(table: xr.Dataset) -> Figure:
    """All variants by two measures, those that no other beats joined by a line."""
    known, rows = directions(table), good(table)
    if len(known) < 2 or not rows.sizes["row"]:
        raise EmptyFigureError('two measures with better = "less" or "more" make a front')
    names = list(known)[:3]
    front = pareto(table)
    figure = new_figure("Pareto front", sweep_caption(table), 6.0, 4.4)
    axes = figure.subplots()
    cloud = _thinned(rows, MOST_POINTS)
    axes.scatter(cloud[names[0]], cloud[names[1]], s=6, lw=0, alpha=0.4, color=GREY)
    if len(names) == 2:
        axes.plot(front[names[0]], front[names[1]], color=ALERT, lw=1.0)
        axes.scatter(front[names[0]], front[names[1]], s=14, color=ALERT, zorder=3)
    else:
        points = axes.scatter(
            front[names[0]], front[names[1]], s=18, c=front[names[2]], cmap="viridis", zorder=3
        )
        figure.colorbar(points, ax=axes, label=_labelled(table, names[2]))
    axes.set_xlabel(f"{_labelled(table, names[0])}: {known[names[0]]} is better")
    axes.set_ylabel(f"{_labelled(table, names[1])}: {known[names[1]]} is better")
    axes.margins(0.05)
    return figure


SWEEP_PLOTS: dict[str, Callable[..., Figure]] = {
    "scatter": sweep_scatter,
    "effects": sweep_effects,
    "parallel": sweep_parallel,
    "front": sweep_front,
}


def sweep_plots(table: xr.Dataset) -> Plots:
    """The figures of a sweep."""
    return Plots(table, SWEEP_PLOTS, "scatter")


def sweep_caption(table: xr.Dataset) -> str:
    """Which study, and how much of it is there."""
    study = json.loads(table.attrs["study"])
    kind = study.get("sampling", {}).get("kind", "grid")
    there, failed = table.sizes["row"], table.sizes["row"] - good(table).sizes["row"]
    name = study.get("mechanism", "masticatory")
    left = f", {failed} without a result" if failed else ""
    return f"Mechanism {name}; sampling {kind}; {there} rows of {table.attrs['rows']}{left}."


def _grid(
    title: str, table: xr.Dataset, measures: list[str], parameters: list[str]
) -> tuple[Figure, np.ndarray]:
    """Panels, measures down and parameters across, with labels at the edges."""
    width, height = 1.2 + 2.2 * len(parameters), 1.0 + 1.8 * len(measures)
    figure = new_figure(title, sweep_caption(table), width, height, len(parameters))
    grid: np.ndarray = figure.subplots(
        len(measures), len(parameters), sharex="col", sharey="row", squeeze=False
    )
    for axes, measure in zip(grid[:, 0], measures, strict=True):
        axes.set_ylabel(_labelled(table, measure))
    for axes, parameter in zip(grid[-1], parameters, strict=True):
        axes.set_xlabel(_short(parameter))
    for axes in grid.ravel():
        axes.margins(0.05)
        axes.locator_params(nbins=4)
    return figure, grid


def _names(table: xr.Dataset) -> tuple[list[str], list[str]]:
    """Measures and parameters, as many as one picture holds."""
    measures, parameters = (list(table.attrs[key]) for key in ("measures", "parameters"))
    return measures[:MOST_PANELS], parameters[:MOST_PANELS]


def _labelled(table: xr.Dataset, measure: str) -> str:
    return labelled(measure, json.loads(table.attrs["units"])[measure])


def _short(path: str) -> str:
    """A path on two lines, where it is long."""
    head, _, tail = path.rpartition(".")
    return f"{head}\n{tail}" if len(path) > 18 and head else path


def _thinned(rows: xr.Dataset, most: int) -> xr.Dataset:
    count = rows.sizes["row"]
    return rows if count <= most else rows.isel(row=np.linspace(0, count - 1, most).astype(int))
