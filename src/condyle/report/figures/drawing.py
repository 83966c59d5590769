"""Panels by matplotlib: each kind of panel on axes, and the axes of a figure in their grid."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from textwrap import fill
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from ...mechanism.vocabulary import words_of
from ...results.failed_samples import longest
from ..actuators import EMG_ROW, REACH
from ..naming import groups, heading, readable, short, stem
from ..panel import Levels, Panel, PanelGroup, Series
from .registry import plot
from .style import (
    ALERT,
    DARK,
    GREY,
    PALETTE,
    TIME,
    XYZ,
    EmptyFigureError,
    break_titles,
    caption,
    extend_caption,
    figsize_is_free,
    labelled,
    look,
    mathematics,
    narrow,
    new_figure,
    on_screen,
    paper_height,
    use_decades,
    written,
)

if TYPE_CHECKING:
    import xarray as xr

Columns = Mapping[str, Mapping[str, tuple[Series, Panel]]]

NO_RESULT = "no result"
MOST_ROWS = 6  # of panels one above the other
MOST_COLUMNS, MOST_IN_PRINT = 4, 3
MOST_ALONE = 4  # planes one above the other in a journal's column; more take the page's width
LOW = 0.2  # part of a panel's height below which a line is at its bottom
WORD = 8  # letters of a name; longer ones do not fit above two panels in a journal's column
MOST_BESIDE = 4  # curves whose names stand above the axes
MANY, CROWDED = 8, 0.86  # names in a legend, beyond which its letters are smaller
TALLEST = 12.4  # inch, of a figure of many rows
NAME = 16  # letters of a line of a name
ORDER = ("first named", "second named")
COLOURS = "YlGnBu"
VIEW_RATIO = 0.7  # height over width of a track's view
BESIDE, BELOW, ABOVE = 0.65, 0.9, 0.7  # labels of a view, and the heading [inch]
LIMIT: dict[str, Any] = {"color": DARK, "lw": 1, "ls": (0, (6, 3))}


def figure_of(group: PanelGroup) -> Callable[..., Figure]:
    """The figure of a group of panels, registered by the group's name."""

    @wraps(group.panels)
    def draw(solution: xr.Dataset, *args: Any, **options: Any) -> Figure:
        drawn, title = list(group.of(solution, *args, **options)), group.title(solution)
        if not drawn:
            raise EmptyFigureError(f"no figure {group.name}: {group.empty}")
        if group.split is not None and solution.sizes["chain"] > group.split:
            columns = split_columns(drawn, [str(name) for name in solution["chain"].values])
            figure = draw_pairs(mathematics(title), solution, columns, group.same)
            extend_caption(figure, what_it_means(drawn))
            return figure
        drawn = [single for panel in drawn for single in single_sets(panel)]
        width, height, columns_ = grid_size(drawn)
        figure = new_figure(mathematics(title), caption(solution), width, height, columns_)
        draw_grid(figure, solution, drawn)
        extend_caption(figure, what_it_means(drawn))
        return figure

    return plot(group.name)(draw)


# -- panels in a grid


def places(panels: Sequence[Panel]) -> tuple[list[tuple[int, int]], int, int]:
    """Row and column of each panel by its `place`, else row by row; and how many there are."""
    if panels[0].kind != "plane":
        keys = [panel.place or (panel.id, "") for panel in panels]
        rows, columns = (list(dict.fromkeys(key[k] for key in keys)) for k in (0, 1))
        return [(rows.index(a), columns.index(b)) for a, b in keys], len(rows), len(columns)
    across = min(most_columns(), max(2, int(np.ceil(np.sqrt(len(panels))))), len(panels))
    across = 1 if narrow() and len(panels) <= MOST_ALONE else across
    return [divmod(i, across) for i in range(len(panels))], -(-len(panels) // across), across


def most_columns() -> int:
    """The most planes side by side."""
    return MOST_COLUMNS if on_screen() else MOST_IN_PRINT


def row_heights(panels: Sequence[Panel]) -> list[float]:
    """Heights of a grid's rows [inch]."""
    tall = {"time": 1.95, "plane": 2.5, "track": 2.6}
    at, rows, _ = places(panels)
    heights = [0.0] * rows
    for panel, (row, _) in zip(panels, at, strict=True):
        field = 0.35 + 0.19 * len(panel.curves)
        own = tall.get(panel.kind, field)
        if panel.kind == "time" and (names := len(panel.curves)) > MOST_BESIDE:
            own = (
                own + legend_height(-(-names // 2)) if narrow() else max(own, legend_height(names))
            )
        heights[row] = max(heights[row], own)
    return heights


def grid_size(panels: Sequence[Panel]) -> tuple[float, float, int]:
    """Width and height of a grid's figure [inch], and its columns."""
    columns = places(panels)[2]
    wide = {"plane": 0.6 + 3.1 * columns, "track": 0.3 + 3.7 * columns}
    width = wide.get(panels[0].kind, max(7.0, 4.1 * columns))
    longest_name = max(len(curve.label) for panel in panels for curve in panel.curves)
    crowded = panels[0].kind == "time" and columns == 2 and longest_name > WORD
    journal = 1 if panels[0].kind == "track" else columns + crowded
    return width, 1.0 + sum(row_heights(panels)), journal


def draw_grid(figure: FigureBase, solution: xr.Dataset, panels: Sequence[Panel]) -> None:
    """Draw panels, each on axes of its own."""
    at, rows, columns = places(panels)
    over_time = panels[0].kind in ("time", "field")
    heights = {"height_ratios": row_heights(panels)}
    grid = figure.subplots(rows, columns, sharex=over_time, squeeze=False, gridspec_kw=heights)
    for panel, place in zip(panels, at, strict=True):
        if panel.kind == "time" and panel.place is None:
            # The heading of a figure says the title of a panel that is alone.
            grid[place].set_title(mathematics(panel.title) if len(panels) > 1 else "")
        DRAW[panel.kind](grid[place], solution, panel)
    used = [grid[place] for place in at]
    for axes in set(grid.ravel()) - set(used):
        axes.remove()
    if panels[0].kind == "track":
        lay_out_tracks(figure, grid)
    elif over_time:
        label_time(grid, used)
        timed = [axes for axes, panel in zip(used, panels, strict=True) if panel.kind == "time"]
        add_legends(figure, timed)


def single_sets(panel: Panel) -> list[Panel]:
    """The panel, or one for each of its sets."""
    if len(panel.choices) == 1:
        return [panel]
    return [
        replace(panel, id=f"{panel.id} {label}", title=label, note="", sets=curves)
        for label, curves in panel.choices.items()
    ]


def label_time(grid: np.ndarray, used: Sequence[Axes]) -> None:
    """Time below the last panel of each column."""
    for column in grid.T:
        own = [axes for axes in column if axes in used]
        for axes in own:
            axes.tick_params(labelbottom=axes is own[-1])
        own[-1].set_xlabel(TIME)
    grid[0, 0].figure.align_ylabels(list(used))


def add_legends(figure: FigureBase, axes: Sequence[Axes]) -> None:
    """One legend for all whose curves have the same names; beside them where there are many."""
    names = [
        [name for name in ax.get_legend_handles_labels()[1] if name != NO_RESULT] for ax in axes
    ]
    if len(axes) > 1 and all(own == names[0] for own in names) and isinstance(figure, Figure):
        legend_above(figure, axes)
        return
    at_side = max(map(len, names), default=0) > MOST_BESIDE
    for ax, own, before in zip(axes, names, [[], *names], strict=False):
        if own and own != before:
            side_legend(ax) if at_side else legend(ax, min(3, len(own)))


# -- pairs of chains


def split_columns(panels: Sequence[Panel], chains: Sequence[str]) -> Columns:
    """Column -> chain -> its curve: of what a panel draws, or of each line that a chain has."""
    columns: dict[str, dict[str, tuple[Series, Panel]]] = {}
    for panel in panels:
        for label, curves in panel.choices.items():
            for curve in curves:
                if label in chains:
                    columns.setdefault(curve.label, {})[label] = curve, panel
                elif not label:
                    word = panel.place[0] if panel.place else ""
                    columns.setdefault(word, {})[curve.label] = curve, panel
    return columns


def draw_pairs(title: str, solution: xr.Dataset, columns: Columns, same: bool) -> Figure:
    """A row for each pair of chains; with `same`, one scale in a column for those of one unit."""
    first = next(iter(columns.values()))
    names = list(first)
    units = [first[name][1].unit for name in names]
    rows = [[names[i] for i in members] for members in groups(names, units)]
    alone, crowded = list(columns) == [""], len(rows) > MOST_ROWS
    dense = len(columns) > 1 and (crowded or narrow())
    two_columns = alone and crowded
    across = 2 if two_columns or (narrow() and len(columns) > 2) else len(columns)
    count = -(-len(rows) // 2) if two_columns else len(rows) * -(-len(columns) // across)
    if alone:
        size = (12.0, 0.9 + 1.45 * count, 3) if two_columns else (7.5, 0.9 + 1.7 * count, 1)
    elif dense:
        size = (8.5, min(1.4 + (0.62 if crowded else 1.2) * count, TALLEST), across)
    else:
        size = (max(6.0, 1.8 + 1.9 * across), 1.1 + 1.7 * count, across)
    figure = new_figure(title, caption(solution), *size)
    grid = figure.subplots(count, across, sharex=True, squeeze=False)
    if alone:
        cells = grid.ravel()[: len(rows)][:, None]
    else:  # columns that do not fit beside each other go on below
        cells = np.hstack(np.vsplit(grid, count // len(rows)))[:, : len(columns)]
    sides = [short(row) for row in rows]
    paired = all(own == sides[0] for own in sides)
    one_unit = len({*units}) == 1
    for row, (line, own, sided) in enumerate(zip(cells, rows, sides, strict=True)):
        labels = list(map(readable, own))
        if dense or two_columns:
            labels = sided if two_columns or paired else list(ORDER[: len(own)])
        panel = first[own[0]][1]
        for axes, (word, column) in zip(line, columns.items(), strict=True):
            panel = column[own[0]][1]
            if alone:
                axes.set_title(heading(own))
            elif row == 0:
                unit = f" [{panel.display.unit}]" if dense and one_unit else ""
                axes.set_title(word + unit, pad=8 if dense else 20)
            draw_curves(axes, solution, panel, [column[name][0] for name in own], labels)
            if not dense:
                draw_limits(axes, panel, own)
        if alone and not (two_columns and paired):
            legend(line[0], 2)
        elif not alone and not dense:
            side_legend(line[-1])
        panel = first[own[0]][1]
        if dense:
            unit = "" if one_unit else f" [{panel.display.unit}]"
            text = fill(heading(own), NAME) + unit
            for axes in line[::across]:
                axes.set_ylabel(text, rotation=0, ha="right", va="center", fontsize=7)
        else:
            line[0].set_ylabel(labelled(panel.axis, panel.display.unit))
    if same:
        for unit in set(units):
            of_unit = [k for k, own in enumerate(rows) if first[own[0]][1].unit == unit]
            for column_axes in cells.T:
                same_scale([column_axes[k] for k in of_unit])
    label_time(grid, list(cells.ravel()))
    for axes in set(grid.ravel()) - set(cells.ravel()):
        axes.remove()
    if two_columns:
        break_titles(figure)
        if paired:
            legend_above(figure, cells[0])
    if dense:
        draw_near_limits(cells, rows, columns)
        for axes in cells.ravel():
            axes.tick_params(labelsize=6)
            axes.yaxis.set_major_locator(MaxNLocator(3))
        legend_above(figure, cells[0])
    return figure


def draw_near_limits(cells: np.ndarray, rows: Sequence[Sequence[str]], columns: Columns) -> None:
    """Limits in the panels whose scale reaches so far."""
    for column, found in zip(cells.T, columns.values(), strict=True):
        for axes, own in zip(column, rows, strict=True):
            panel, (low, high) = found[own[0]][1], axes.get_ylim()
            limits = [one for one in panel.limits if {*own} & {*one.of}]
            for level in {v * panel.display.scale for one in limits for v in (one.low, one.high)}:
                if low <= level <= high:
                    axes.axhline(level, **LIMIT | {"lw": 0.8})


def same_scale(column: Sequence[Axes]) -> None:
    """Give axes one vertical scale with zero on it, so that their curves can be compared."""
    curves = [np.asarray(line.get_ydata()) for axes in column for line in axes.get_lines()]
    low = min(float(np.nanmin(curve, initial=0.0)) for curve in curves)
    high = max(float(np.nanmax(curve, initial=0.0)) for curve in curves)
    margin = 0.06 * (high - low)
    for axes in column:
        if margin > 0:
            axes.set_ylim(low - margin, high + margin)


# -- curves over time


def looks(panel: Panel, curves: Sequence[Series]) -> Sequence[dict[str, Any]]:
    """A pair has one colour, and every line dashes of its own; bands differ in colour."""
    if panel.components:
        return XYZ
    names = [curve.label for curve in curves]
    stems = list(dict.fromkeys(map(stem, names)))
    banded = any(curve.bands is not None for curve in curves)
    return [look(i if banded else stems.index(stem(name)), i) for i, name in enumerate(names)]


def draw_time(axes: Axes, solution: xr.Dataset, panel: Panel) -> None:
    """Curves over time, with what they mean."""
    curves = panel.curves
    labels = [written(c.label) if panel.components else readable(c.label) for c in curves]
    labels = ["" if label == panel.axis else label for label in labels]  # the axis has that name
    draw_curves(axes, solution, panel, curves, labels, looks(panel, curves))
    values = np.concatenate([c.values[np.isfinite(c.values)] for c in curves])
    if values.size and values.min() < 0 < values.max():
        axes.axhline(0, color=GREY, lw=0.8, zorder=1)
    axes.set_ylabel(labelled(panel.axis, panel.display.unit))
    if panel.log:
        use_decades(axes, values)
    draw_limits(axes, panel, [curve.label for curve in curves])


def draw_curves(
    axes: Axes,
    solution: xr.Dataset,
    panel: Panel,
    curves: Sequence[Series],
    labels: Sequence[str],
    styles: Sequence[dict[str, Any]] | None = None,
) -> None:
    """Curves with their bands, the outer ones paler; samples without a result are shaded."""
    time, scale = solution["time"].values, panel.display.scale
    styles = styles or [look(i) for i in range(len(curves))]
    for curve, label, style in zip(curves, labels, styles, strict=True):
        axes.plot(time, curve.values * scale, label=label, **style)
        bands = np.empty((0, 0)) if curve.bands is None else curve.bands * scale
        for low, high in zip(bands[: len(bands) // 2], bands[::-1], strict=False):
            axes.fill_between(time, low, high, color=style["color"], alpha=0.18, lw=0)
    if len(time) > 1:
        axes.set_xlim(time[0], time[-1])
    for i, failure in enumerate(longest(solution.condyle.failures)):
        named = NO_RESULT if i == 0 else None
        axes.axvspan(failure.start, failure.end, color=GREY, alpha=0.2, lw=1, label=named)


def draw_limits(axes: Axes, panel: Panel, names: Sequence[str]) -> None:
    """Limits as lines where the data reach so far; one at 0 is the axis."""
    for limit in panel.limits:
        if (limit.of and not {*names} & {*limit.of}) or is_far(limit, panel):
            continue
        text = readable(limit.label(names))
        levels = [level * panel.display.scale for level in near_levels(limit, panel)]
        for level in levels:
            axes.axhline(level, **LIMIT)
        place, at = axes.get_yaxis_transform(), max(levels, default=0.0)
        small: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7, "color": DARK}
        low, high = axes.get_ylim()
        # Above a line a title may stand, below one that is low the axis.
        below = levels and at - low > LOW * (high - low)
        side = ("top", -2) if below else ("bottom", 2)
        axes.annotate(text, (0, at), (3, side[1]), va=side[0], xycoords=place, **small)


def near_levels(limit: Levels, panel: Panel) -> list[float]:
    """Levels of a limit, other than 0, that the view of a panel reaches, in SI."""
    peak = max(float(np.nanmax(np.abs(curve.values), initial=0.0)) for curve in panel.curves)
    return [level for level in (limit.high, limit.low) if level and abs(level) <= REACH * peak]


def is_far(limit: Levels, panel: Panel) -> bool:
    """Whether a limit has levels, and all are outside the view."""
    levels = [level for level in (limit.high, limit.low) if level and np.isfinite(level)]
    return bool(levels) and not near_levels(limit, panel)


def what_it_means(panels: Sequence[Panel]) -> list[str]:
    """Sentences of a caption: notes of panels, and limits that are too far off to be drawn."""
    notes = {panel.title: panel.note for panel in panels if panel.kind in ("time", "field")}
    alone = len(panels) == 1
    sentences = [text if alone else f"{title}: {text}" for title, text in notes.items() if text]
    far = []
    for panel in panels:
        names = [curve.label for curve in panel.curves]
        for limit in panel.limits:
            if is_far(limit, panel):
                whose = "" if {*names} <= {*limit.of} or not limit.of else heading(limit.of)
                far.append(limit.text + f" ({whose})" * bool(whose))
    return sentences + ([f"Outside the view: {', '.join(far)}."] if far else [])


# -- the other kinds


def draw_field(axes: Axes, solution: xr.Dataset, panel: Panel) -> None:
    """Rows of colour from 0 to the panel's top; beyond 1, and without a result, other colours."""
    names = [curve.label for curve in panel.curves]
    values = np.array([np.abs(c.values) * (c.scale or 1.0) for c in panel.curves])
    colours = colormaps[COLOURS].with_extremes(bad="#DDDDDD", over=ALERT)
    edges, rows = boundaries(solution["time"].values), np.arange(len(names) + 1)
    look: dict[str, Any] = {"cmap": colours, "vmin": 0.0, "vmax": panel.top, "rasterized": True}
    drawn = axes.pcolormesh(edges, rows, np.ma.masked_invalid(values), **look)
    labels = [f"{readable(c.label)} {c.text}".rstrip() for c in panel.curves]
    axes.set_yticks(rows[:-1] + 0.5, labels, fontsize=7)
    for name, label in zip(names, axes.get_yticklabels(), strict=True):
        if name.endswith(EMG_ROW):
            label.set(style="italic", color=GREY)
    axes.invert_yaxis()
    axes.grid(False)
    # A line between pairs, so that rows can be followed to their names.
    stems = [stem(name.removesuffix(EMG_ROW)) for name in names]
    for level in [i for i in range(1, len(stems)) if stems[i] != stems[i - 1]]:
        axes.axhline(level, color=GREY, lw=0.6)
    over = bool(np.nanmax(values, initial=0.0) > 1.0)
    beside = axes.inset_axes((1.015, 0.0, 0.018, 1.0))  # no panel of its own
    axes.figure.colorbar(drawn, cax=beside, extend="max" if over else "neither")
    axes.set_ylabel(labelled(panel.axis, panel.unit))
    if over:
        say = words_of(solution.condyle.mechanism)
        axes.set_title(say("orange: beyond the greatest effort"))


def boundaries(time: np.ndarray) -> np.ndarray:
    """Where one sample's colour ends and the next begins, (N + 1,) [s]."""
    if len(time) < 2:
        return time[0] + np.array([-0.5, 0.5])
    return np.concatenate([time[:1], 0.5 * (time[1:] + time[:-1]), time[-1:]])


def draw_plane(axes: Axes, solution: xr.Dataset, panel: Panel) -> None:
    """Curves over what is across, and the box of their limits as far as it is near."""
    names = short([curve.label for curve in panel.curves])
    for i, (curve, name) in enumerate(zip(panel.curves, names, strict=True)):
        assert curve.across is not None
        axes.plot(curve.across[1], curve.values, label=f"{name}: {curve.text}", **look(i))
    for xs, ys in panel.lines:
        axes.plot(xs, ys, **LIMIT)
    axes.margins(0.06)
    axes.locator_params(nbins=5)
    axes.ticklabel_format(axis="y", scilimits=(-4, 5))  # a power of ten would stand in the title
    axes.legend(
        title=f"limits: {panel.note}", loc="lower right" if narrow() else "lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.0, borderpad=0.2, alignment="left", title_fontsize="small",
    )  # fmt: skip
    axes.set_title(panel.title, pad=13 * (1 + len(names)))
    axes.set(xlabel=panel.across, ylabel=labelled(panel.axis, panel.unit))


def draw_track(axes: Axes, solution: xr.Dataset, panel: Panel) -> None:
    """A track on equal scales with its bounds; where it is out of them stands out."""
    [curve], scale = panel.curves, panel.display.scale
    assert curve.across is not None and panel.outside is not None
    x, y = curve.across[1] * scale, curve.values * scale
    axes.plot(x, y, color=PALETTE[0], lw=1.5, label=curve.label)
    axes.plot(x[:1], y[:1], "o", color=PALETTE[0], ms=4, label="start")
    if (out := panel.outside).any():
        axes.plot(x[out], y[out], ".", color=ALERT, ms=4, label="out of bounds")
    across, up = (None if one is None else np.multiply(one, scale) for one in panel.bounds)
    look: dict[str, Any] = {"color": GREY, "lw": 1.0, "ls": (0, (4, 2)), "label": "bounds"}
    if across is not None and up is not None:
        (x0, x1), (y0, y1) = across, up
        axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, **look))
    else:
        for interval, line in zip((across, up), (axes.axvline, axes.axhline), strict=True):
            for value in () if interval is None else interval:
                line(value, **look)
                look.pop("label", None)
    frame(axes)
    for xs, ys in panel.lines:
        axes.plot(xs * scale, ys * scale, color=PALETTE[2], lw=1.0, zorder=1, label=panel.note)
    unit = panel.display.unit
    axes.set(xlabel=labelled(panel.across, unit), ylabel=labelled(panel.axis, unit))
    axes.set_title(readable(panel.title))


def frame(axes: Axes) -> None:
    """Equal scales, with room around everything drawn."""
    axes.autoscale_view()
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    width = 1.15 * max(x1 - x0, (y1 - y0) / VIEW_RATIO)
    x, y, height = (x0 + x1) / 2, (y0 + y1) / 2, VIEW_RATIO * width
    axes.set(xlim=(x - width / 2, x + width / 2), ylim=(y - height / 2, y + height / 2))
    axes.locator_params(axis="x", nbins=5)
    axes.set_aspect("equal", adjustable="box")


def lay_out_tracks(figure: FigureBase, grid: np.ndarray) -> None:
    """The views have a shape of their own, and the figure follows."""
    assert isinstance(figure, Figure)
    if figsize_is_free():
        wide = figure.get_figwidth() / grid.shape[1] - BESIDE
        figure.set_figheight(2 * (VIEW_RATIO * wide + BELOW) + (2 if narrow() else 1) * ABOVE)
    figure.set_layout_engine("compressed", w_pad=0.12, h_pad=0.1)  # made for axes of fixed shape
    legend_above(figure, grid.ravel(), 4 if grid.shape[1] > 1 else 2)


DRAW: dict[str, Callable[[Axes, Any, Panel], None]] = {
    "time": draw_time,
    "field": draw_field,
    "plane": draw_plane,
    "track": draw_track,
}


# -- legends


def side_legend(axes: Axes) -> None:
    """A legend to the right of the axes, above them where there is no room."""
    small = CROWDED * mpl.rcParams["legend.fontsize"] if len(axes.get_lines()) > MANY else None
    if narrow():
        legend(axes, 2, small)
    else:
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=small)


def legend(axes: Axes, columns: int = 1, size: float | None = None) -> None:
    """A legend above the axes' right end, where no curve runs."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=columns, borderaxespad=0.0,
        fontsize=size,
    )  # fmt: skip


def legend_height(rows: int) -> float:
    """The height of a legend before the figure's height is that of its paper [inch]."""
    return 1.45 * rows * mpl.rcParams["legend.fontsize"] / 72 / paper_height()


def legend_above(figure: Figure, panels: Iterable[Axes], columns: int = 3) -> None:
    """One legend between the heading and all panels, each label once."""
    entries: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        entries |= dict(zip(labels, handles, strict=True))
    columns = 2 if narrow() else columns
    rows = -(-len(entries) // columns)
    # The heading keeps the room: blank lines below it.
    large, small = mpl.rcParams["figure.titlesize"], mpl.rcParams["legend.fontsize"]
    title = figure.get_suptitle()
    blank = -(-int(rows * 2.0 * small) // int(1.2 * large))
    figure.suptitle(title + "\n" * blank, x=0.01, ha="left")
    below = (1.9 + 1.2 * title.count("\n")) * large if title else 0.0
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="upper left",
        bbox_to_anchor=(0.0, 1.0 - below / (72 * figure.get_figheight())),
        ncols=columns,
    )
