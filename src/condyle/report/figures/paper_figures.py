"""The path of a platform point in space, and Figures 5 to 9 of the paper."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure, FigureBase
from matplotlib.patheffects import withStroke

from ..naming import LOAD_PARTS
from ..panel import Series
from ..panel_list import effort, motion
from ..scene import rotations
from .drawing import draw_grid, draw_pairs
from .registry import PLOTS, plot
from .style import PALETTE, caption, house, narrow, new_figure, on_screen

if TYPE_CHECKING:
    import xarray as xr

    from ...analysis.comparison import Comparison
    from ...analysis.runs import Run

PAPER_ORDER = ("platform", "cranks", "couplers")


@house
def figure_5(solution: xr.Dataset) -> Figure:
    """The paper's Fig. 5: path and coordinates."""
    title = f"Motion of the platform: path of {landmark(solution)[0]}, and coordinates"
    figure = new_figure(title, caption(solution), 10, 9)
    [above], [below] = figure.subfigures(2, 1, squeeze=False, height_ratios=(1, 2.4))
    draw_path(above, solution)
    draw_grid(below, solution, list(motion(solution)))
    return figure


@house
def figure_8(comparison: Comparison) -> Figure:
    """The paper's Fig. 8: torques of Model 1, and how far other models are from them."""
    solution = comparison.solution
    first, others = first_and_others(comparison)
    columns = {first.label: first.effort}
    columns |= {f"{first.label} − {one.label}": first.effort - one.effort for one in others}
    names = [str(name) for name in solution["chain"].values]
    panels = {c.label: replace(p, limits=()) for p in effort(solution) for c in p.curves}
    cells = {
        title: {n: (Series(n, "", values[:, i]), panels[n]) for i, n in enumerate(names)}
        for title, values in columns.items()
    }
    title = f"Efforts by {first.label}, and differences to other models"
    return draw_pairs(title, solution, cells, same=True)


def figure_9(solution: xr.Dataset) -> Figure:
    """The paper's Fig. 9: end effector, cranks and couplers, without the load."""
    there = [str(part) for part in solution["part"].values if part not in LOAD_PARTS]
    first = [part for part in PAPER_ORDER if part in there]
    return PLOTS["share"](solution, first + [part for part in there if part not in first])


def first_and_others(comparison: Comparison) -> tuple[Run, list[Run]]:
    """Model 1 (momentum, direct) and the two the paper sets against it, as far as there are."""
    wanted = [(name, route) for name in ("momentum", "lagrange") for route in ("direct", "core")]
    found = [run for key in wanted if (run := comparison.run(*key)) is not None]
    found += [run for run in comparison.runs if run not in found]
    return found[0], found[1:3]


VIEWS = (
    ("side (sagittal)", "X", "Z"),
    ("front (frontal)", "Y", "Z"),
    ("above (horizontal)", "X", "Y"),
)
DEFAULT_LANDMARK = "incisor"


@plot()
def path(solution: xr.Dataset) -> Figure:
    """Path of a platform point from the side, the front, above and in space."""
    height = 4.4 if narrow() else 2.9
    figure = new_figure(f"Path of {landmark(solution)[0]}", caption(solution), 10, height)
    draw_path(figure, solution)
    return figure


def draw_path(figure: FigureBase, solution: xr.Dataset) -> None:
    point = landmark(solution)[1]
    place = track(solution, point) * 1e3
    if narrow():
        row = [figure.add_subplot(2, 2, i) for i in (1, 2, 3)]
        axes_in_space = figure.add_subplot(2, 2, 4, projection="3d")
    else:
        [[flat, space]] = figure.subfigures(1, 2, squeeze=False, width_ratios=(3, 1.2))
        row = flat.subplots(1, 3)
        axes_in_space = space.add_subplot(projection="3d")
    home = point * 1e3
    for axes, (view, across, up) in zip(row, VIEWS, strict=True):
        i, j = "XYZ".index(across), "XYZ".index(up)
        axes.plot(place[:, i], place[:, j], color=PALETTE[0], lw=0.9)
        axes.plot(home[i], home[j], "o", color=PALETTE[1], ms=4)
        axes.set(title=view, xlabel=f"{across} [mm]", ylabel=f"{up} [mm]")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.1)
    over = {"path_effects": [withStroke(linewidth=2.5, foreground="white")], "zorder": 4}
    small: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8} | over
    row[0].annotate("home", (home[0], home[2]), (6, -3), **small)
    axes = axes_in_space
    axes.plot(*place.T, color=PALETTE[0], lw=0.9)
    axes.plot(*home[:, None], "o", color=PALETTE[1], ms=4)
    axes.set_title("in space")
    unit = "" if narrow() else " [mm]"
    axes.set(xlabel=f"X{unit}", ylabel=f"Y{unit}", zlabel=f"Z{unit}")
    axes.tick_params(labelsize=7, pad=0)
    axes.locator_params(nbins=4)
    if narrow():  # no room for numbers, which the other views have
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_ticklabels([])
            axis.labelpad = -14
    axes.set_box_aspect(None, zoom=0.74 if on_screen() else 0.66)  # leaves room for the labels


def landmark(solution: xr.Dataset) -> tuple[str, np.ndarray]:
    """The point whose path is drawn: of the motion, the only one, the incisor, or O_M."""
    points = solution.condyle.mechanism.platform.points
    only = next(iter(points)) if len(points) == 1 else DEFAULT_LANDMARK
    name = solution.condyle.options["landmark"] or only
    if name in points:
        return name, np.array(points[name])
    return "the mass centre", np.zeros(3)


def track(solution: xr.Dataset, point: np.ndarray) -> np.ndarray:
    """Places of a platform point in {S}, (N, 3) [m]."""
    pose = solution["pose"].values
    return pose[:, :3] + rotations(pose[:, 3:]) @ point
