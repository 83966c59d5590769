"""The path of a platform point in space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure, FigureBase

from ..scene import rotations
from .caption import caption
from .registry import plot
from .style import PALETTE, narrow, new_figure

if TYPE_CHECKING:
    from ...results.solution import Solution

VIEWS = (
    ("side (sagittal)", "X", "Z"),
    ("front (frontal)", "Y", "Z"),
    ("above (horizontal)", "X", "Y"),
)
DEFAULT_LANDMARK = "incisor"


@plot()
def path(solution: Solution) -> Figure:
    """Path of a platform point from the side, the front, above and in space."""
    height = 4.4 if narrow() else 2.9
    figure = new_figure(f"Path of {landmark(solution)[0]}", caption(solution), 10, height)
    draw_path(figure, solution)
    return figure


def draw_path(figure: FigureBase, solution: Solution) -> None:
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
    row[0].annotate("home", (home[0], home[2]), (6, -3), textcoords="offset points", fontsize=8)
    axes = axes_in_space
    axes.plot(*place.T, color=PALETTE[0], lw=0.9)
    axes.plot(*home[:, None], "o", color=PALETTE[1], ms=4)
    axes.set_title("in space")
    axes.set(xlabel="X [mm]", ylabel="Y [mm]")
    axes.set_zlabel("Z [mm]")
    axes.tick_params(labelsize=7, pad=0)
    axes.locator_params(nbins=4)
    axes.set_box_aspect(None, zoom=0.78)  # leaves room for the labels


def landmark(solution: Solution) -> tuple[str, np.ndarray]:
    """The point whose path is drawn: of the motion, the only one, the incisor, or O_M."""
    points = solution.mechanism.platform.points
    only = next(iter(points)) if len(points) == 1 else DEFAULT_LANDMARK
    name = solution.options["landmark"] or only
    if name in points:
        return name, np.array(points[name])
    return "the mass centre", np.zeros(3)


def track(solution: Solution, point: np.ndarray) -> np.ndarray:
    """Places of a platform point in {S}, (N, 3) [m]."""
    pose = solution["pose"].values
    return pose[:, :3] + rotations(pose[:, 3:]) @ point
