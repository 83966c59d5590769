"""Pictures of maps: filled contours, the border of the workspace, singular curves, a run on top."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ...analysis.map.lines import Slice, slices_of
from ...mechanism.mechanism import COORDINATES
from ...mechanism.vocabulary import words_of
from ...model.model import Model, derive
from ...quantities.entries import WRENCH
from ...results.contacts import joint_loads, load_sign
from ..naming import readable
from ..panel import display_unit
from .registry import Plots
from .style import (
    ALERT,
    COORDINATE,
    DARK,
    DASHES,
    GREY,
    PALETTE,
    house,
    labelled,
    look,
    mathematics,
    narrow,
    new_figure,
    use_decades,
)

if TYPE_CHECKING:
    import xarray as xr

MOST_PANELS = 12
LEVELS = 20
COLOURS = "viridis"
OUT, FREE, PALE = "#DDDDDD", "#F4FAF4", 0.75
LOGARITHMIC = {"ratio": 3.0, "condition": 3.0}  # by what their values must differ
WIDE = 30.0  # likewise of all others
NOT_DRAWN = ("status", "kind", "stiffness_matrix")
RUN: dict[str, Any] = {"color": PALETTE[1], "lw": 1.2}
# Kind of a traced line -> how it is drawn, and what the legend calls it.
LINES: dict[str, tuple[dict[str, Any], str]] = {
    "reach": ({"color": DARK, "lw": 1.4}, "reach of a chain"),
    "stroke": ({"color": DARK, "lw": 1.4, "ls": DASHES[1]}, "stroke of a joint"),
    "contacts": ({"color": PALETTE[0], "lw": 1.4}, "contacts can be met"),
    "bounds": ({"color": PALETTE[3], "lw": 1.2, "ls": DASHES[1]}, "bounds of a contact"),
    "singular": ({"color": ALERT, "lw": 1.8}, "direct singularity"),
}


@dataclass(frozen=True)
class MapPanel:
    """One variable, or one entry of it along its own dimension."""

    title: str
    variable: str
    entry: int | None


def drawn(dataset: xr.Dataset) -> list[str]:
    """Variables of a map that have a picture; `cause` shows what can be reached."""
    return [str(name) for name in dataset.data_vars if name not in NOT_DRAWN]


def map_plots(dataset: xr.Dataset, model: Model | None = None) -> Plots:
    """A figure for each variable of a map, by its name; `cause` as `reach`.

    Each takes `run`: a solution, whose motion is drawn on top, or (N, axes) [m or rad].

    Args: model: of the map's mechanism, which traces borders; by default it is derived.
    """
    made = cache(lambda: list(slices_of(dataset, model or derive(dataset.condyle.mechanism))))

    def of(variable: str) -> Callable[..., Figure]:
        def draw(
            dataset: xr.Dataset, run: xr.Dataset | np.ndarray | None = None, **options: Any
        ) -> Figure:
            if run is not None and not isinstance(run, np.ndarray):
                run = run["pose"].sel(coordinate=list(dataset["status"].dims)).values
            return map_figure(dataset, variable, made(), run, **options)

        draw.__doc__ = f"{dataset[variable].attrs['long_name']}."
        return draw

    names = {"reach" if name == "cause" else name: name for name in drawn(dataset)}
    figures = {name: of(variable) for name, variable in names.items()}
    return Plots(dataset, figures, next(reversed(figures)))


@house
def map_figure(
    dataset: xr.Dataset,
    variable: str,
    slices: Sequence[Slice] = (),
    run: np.ndarray | None = None,
) -> Figure:
    """One variable of a map.

    Args: slices: of maps over two or three coordinates.
          run: a motion on top of it, (N, axes) [m or rad].
    """
    axes = [str(dim) for dim in dataset["status"].dims]
    panels = list(_panels(dataset, variable, len(axes)))
    about, mechanism = dataset[variable].attrs, dataset.condyle.mechanism
    say = words_of(mechanism)
    title = mathematics(say(about["long_name"][0].upper() + about["long_name"][1:]))
    if variable == "contact_force":
        title = say(f"Contact force at rest, {load_sign(mechanism)}")
        loads = joint_loads(mechanism, dataset[variable].values)
        dataset = dataset.assign(contact_force=dataset[variable].copy(data=loads))
    if len(axes) == 1:
        return _over_axis(dataset, variable, panels, axes[0], title, run)
    pictures = [(panel, cut) for panel in panels for cut in slices]
    columns = min(3, len(pictures))
    rows = -(-len(pictures) // columns)
    figure = new_figure(
        title,
        _caption(dataset, axes),
        1.2 + 3.1 * columns + 2.2 * (len(pictures) == 1),
        1.1 + 2.6 * rows,
        columns,
    )
    grid = figure.subplots(rows, columns, squeeze=False)
    used: set[str] = set()
    for place, (panel, cut) in zip(grid.flat, pictures, strict=False):
        used |= _picture(place, dataset, panel, cut, axes, run)
    for place in grid.flat[len(pictures) :]:
        place.axis("off")
    handles: list[Any] = [
        Line2D([], [], **style, label=say(name))
        for kind, (style, name) in LINES.items()
        if kind in used
    ]
    if run is not None:
        handles.append(Line2D([], [], **RUN, label="motion of the run"))
    if variable == "cause":
        handles += _colours(dataset)[1]
    else:
        handles.append(Patch(facecolor=OUT, label="out of reach"))
    if len(pictures) == 1 and narrow():
        grid[0, 0].legend(handles=handles, loc="lower right", ncols=2)  # `make_room` lifts it
    elif len(pictures) == 1:  # beside the caption there is no room
        figure.legend(handles=handles, loc="outside right upper", fontsize=7)
    else:
        figure.legend(handles=handles, loc="outside lower right", ncols=2 * columns)
    return figure


def _panels(dataset: xr.Dataset, variable: str, axes: int) -> Iterator[MapPanel]:
    dims = dataset[variable].dims[axes:]
    if not dims:
        yield MapPanel("", variable, None)
        return
    names = [str(name) for name in dataset[dims[0]].values]
    keep = range(len(names))
    if dims[0] == "coordinate":  # those that the contacts determine
        moved = {*map(str, dataset["status"].dims), *json.loads(dataset.attrs["held"])}
        keep = [i for i in keep if names[i] not in moved] or keep  # type: ignore[assignment]
    for i in list(keep)[:MOST_PANELS]:
        title = f"mode {names[i]}" if dims[0] == "mode" else readable(names[i])
        yield MapPanel(COORDINATE.get(title, title), variable, i)


def _units(dataset: xr.Dataset, panel: MapPanel) -> tuple[str, float]:
    units = dataset[panel.variable].attrs["units"].split(", ")
    index = panel.entry if panel.entry is not None and len(units) > panel.entry else 0
    return display_unit(units[index])


def _label(name: str) -> tuple[str, float]:
    unit, scale = display_unit("m" if name in COORDINATES[:3] else "rad")
    return f"{COORDINATE.get(name, name)} [{unit}]", scale


def _value(name: str, value: float) -> str:
    """'α = 10 °'."""
    label, scale = _label(name)
    symbol, unit = label.split(" ")
    return f"{symbol} = {value * scale:.3g} {unit.strip('[]')}"


def _picture(
    place: Any,
    dataset: xr.Dataset,
    panel: MapPanel,
    cut: Slice,
    axes: Sequence[str],
    run: np.ndarray | None,
) -> set[str]:
    """Draw one slice; returns the kinds of lines in it."""
    labels, scales = zip(*(_label(name) for name in axes[:2]), strict=True)
    x, y = (dataset[name].values * scale for name, scale in zip(axes, scales, strict=False))
    values = dataset[panel.variable].values
    values = values[..., panel.entry] if panel.entry is not None else values
    here = values[:, :, cut.index] if cut.index is not None else values
    place.set_facecolor(OUT)
    place.grid(False)
    if panel.variable == "cause":
        colours = _colours(dataset)[0]
        edges = [*(i - 0.5 for i in colours), max(colours) + 0.5]
        shades: dict[str, Any] = {"cmap": ListedColormap(list(colours.values())), "alpha": PALE}
        place.pcolormesh(x, y, here.T, norm=BoundaryNorm(edges, len(colours)), **shades)
    else:
        unit, scale = _units(dataset, panel)
        _filled(place, x, y, here * scale, values * scale, panel.variable, unit)
        u, v = (a * scale for a, scale in zip(cut.values, scales, strict=True))
        outside = np.where(np.isfinite(cut.margin), cut.margin, -1.0)
        place.contourf(u, v, outside.T, levels=[-np.inf, 0.0], colors=[OUT], zorder=2)
    for line in cut.lines:
        points = np.vstack([line.points, line.points[:1]]) if line.closed else line.points
        place.plot(*(points * scales).T, **LINES[line.kind][0], zorder=3)
    if run is not None:
        place.plot(*(run[:, :2] * scales).T, **RUN, zorder=5)
    place.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), xlabel=labels[0], ylabel=labels[1])
    heading = [panel.title] if panel.title else []
    if cut.at is not None:
        heading.append(_value(axes[2], cut.at))
    place.set_title(", ".join(heading))
    return {line.kind for line in cut.lines}


def _filled(
    place: Any,
    x: np.ndarray,
    y: np.ndarray,
    field: np.ndarray,
    of_all: np.ndarray,
    variable: str,
    unit: str,
) -> None:
    """Contours; colours are those of all slices."""
    good = of_all[np.isfinite(of_all)]
    if not good.size:
        place.text(0.5, 0.5, "out of reach", ha="center", transform=place.transAxes, color=GREY)
        return
    low, high = np.quantile(good, [0.002, 0.998])
    options: dict[str, Any] = {"cmap": COLOURS, "extend": "both"}
    if good.min() > 0 and high > LOGARITHMIC.get(variable, WIDE) * low:
        levels = np.geomspace(low, high, LEVELS)
        options["norm"] = LogNorm(low, high)
    else:
        levels = np.linspace(low, high if high > low else low + 1.0, LEVELS)
    masked = np.ma.masked_invalid(grown(field)).T
    filled = place.contourf(x, y, masked, levels=levels, **options)
    bar = place.figure.colorbar(filled, ax=place, format=lambda value, _: f"{value:.3g}")
    bar.set_ticks(list(levels[:: max((len(levels) - 1) // 5, 1)]))
    bar.ax.minorticks_off()
    bar.set_label(labelled("", unit))


def _colours(dataset: xr.Dataset) -> tuple[dict[int, str], list[Patch]]:
    """Colours of what forbids poses, and of those that nothing forbids."""
    names = dataset["cause"].attrs["flag_meanings"].split()
    found = map(int, np.unique(dataset["cause"].values))
    colours = {i: FREE if i == 0 else PALETTE[(i - 1) % len(PALETTE)] for i in found}
    return colours, [
        Patch(fc=c, ec=GREY, alpha=PALE, label=f"no: {readable(names[i])}" if i else "reachable")
        for i, c in colours.items()
    ]


def grown(field: np.ndarray, rounds: int = 2) -> np.ndarray:
    """A field (n1, n2) with its mean carried over the border by some cells, which are painted over.

    So that colours reach the traced border, not only the last grid point before it.
    """
    field = np.array(field, dtype=float)
    field[~np.isfinite(field)] = np.nan
    for _ in range(rounds):
        wide = np.pad(field, 1, constant_values=np.nan)
        n1, n2 = field.shape
        around = [wide[i : i + n1, j : j + n2] for i in range(3) for j in range(3)]
        known = [np.isfinite(a) for a in around]
        count = np.sum(known, axis=0)
        total = np.sum([np.where(k, a, 0.0) for k, a in zip(known, around, strict=True)], axis=0)
        mean = np.divide(total, count, out=np.full(field.shape, np.nan), where=count > 0)
        field = np.where(np.isfinite(field), field, mean)
    return field


def _over_axis(
    dataset: xr.Dataset,
    variable: str,
    panels: Sequence[MapPanel],
    axis: str,
    title: str,
    run: np.ndarray | None,
) -> Figure:
    """A map over one coordinate: lines."""
    figure = new_figure(title, _caption(dataset, [axis]), 6.5, 3.4)
    place = figure.add_subplot()
    label, scale = _label(axis)
    x = dataset[axis].values * scale
    values = dataset[variable].values
    unit, factor = _units(dataset, panels[0])
    steps: dict[str, Any] = {"drawstyle": "steps-mid"} if variable == "cause" else {}
    for i, panel in enumerate(panels):
        own = values if panel.entry is None else values[:, panel.entry]
        shown = np.where(np.isfinite(own), own, np.nan) * factor
        place.plot(x, shown, label=panel.title, **look(i), **steps)
    if variable in LOGARITHMIC:
        use_decades(place, values * factor)
    out = dataset["cause"].values > 0
    if out.any():
        across: dict[str, Any] = {"transform": place.get_xaxis_transform(), "fc": OUT, "ec": GREY}
        place.fill_between(x, 0, 1, where=out, label="out of reach", **across)
    if run is not None:
        place.axvspan(
            run.min() * scale, run.max() * scale, color=PALETTE[2], alpha=0.15, label="run"
        )
    place.set_xlabel(label)
    place.set_ylabel(labelled("", unit))
    if variable == "cause":
        names = dataset["cause"].attrs["flag_meanings"].split()
        found = [int(i) for i in np.unique(values)]
        place.set_yticks(found, ["reachable" if i == 0 else readable(names[i]) for i in found])
        place.set_ylabel("")
    elif place.get_legend_handles_labels()[1]:
        place.legend(fontsize=7)
    return figure


def _caption(dataset: xr.Dataset, axes: Sequence[str]) -> str:
    held = json.loads(dataset.attrs["held"])
    parts = [_value(name, value) for name, value in held.items()]
    pairs = zip(WRENCH, np.asarray(dataset.attrs["load"])[:6], strict=True)
    units = ("N", "N m")
    loads = [f"{name} = {v:g} {units[name[0] == 'M']}" for name, v in pairs if v]
    text = f"Mechanism {dataset.attrs['mechanism_name']}, at rest"
    text += f"; held {', '.join(parts)}" if parts else ""
    return text + (f"; load {', '.join(loads)}" if loads else "") + "."
