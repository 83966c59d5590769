"""A jaw from the front and from the side at one instant: muscles, and forces as arrows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure

from ...errors import InputError
from ...mechanism.vocabulary import of_muscles
from ..naming import readable
from ..panel_list import activation_top, colour_values
from ..scene import (
    VIEWS,
    Camera,
    Faces,
    Force,
    activation_colour,
    faces_of,
    forces_of,
    parts_of,
    place,
)
from .registry import plot
from .style import DARK, EmptyFigureError, caption, narrow, new_figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

LONGEST = 0.34  # arrow, over the diagonal of a picture
ROOM = 0.2  # for labels, over the same
NEAR = 0.3  # labels, over a picture's width, that stand beside each other
SHOWN = {"Front": "frontal, from the front", "Side": "sagittal, from the right"}
JOINT, BITE = "#a3104e", DARK


@plot()
def forces(solution: xr.Dataset, time: float | None = None) -> Figure:
    """Forces on the jaw from the front and the side, and muscles coloured by activation.

    Args: time: of the sample drawn [s]; by default that of the largest load, or joint force.
    """
    mechanism = solution.condyle.mechanism
    if not of_muscles(mechanism):
        raise EmptyFigureError("no figure forces: this machine has no muscles")
    sample = _sample(solution, time)
    at = solution.isel(time=[sample])
    scene = place(mechanism, at["pose"].values, at["joint"].values)
    parts = parts_of(mechanism, scene)
    activation = {name: float(values[sample]) for name, values in colour_values(solution).items()}
    drawn = faces_of(parts, scene, activation=activation)
    arrows = [
        (force, scene.on_platform(force.at)[0], force.vector[0])
        for force in forces_of(at, scene, parts)
    ]
    when = solution["time"].values[sample]
    column = narrow()
    size = (7.0, 7.6) if column else (9.2, 4.6)
    figure = new_figure(f"Forces on the jaw at {when:g} s", caption(solution), *size)
    figure.set_layout_engine("compressed")  # made for axes of fixed shape
    grid = figure.subplots(*((2, 1) if column else (1, 2)), squeeze=False).ravel()
    for axes, (view, title) in zip(grid, SHOWN.items(), strict=True):
        _draw(axes, Camera.of(*VIEWS[view]), drawn, arrows)
        axes.set_title(title)
    low, high = np.transpose([axes.get_ylim() for axes in grid])
    wide = max(np.ptp(axes.get_xlim()) for axes in grid) / 2
    for axes in grid:  # one scale
        middle = np.mean(axes.get_xlim())
        axes.set(xlim=(middle - wide, middle + wide), ylim=(low.min(), high.max()))
    top = activation_top(solution)
    stops = [activation_colour(value) for value in np.linspace(0.0, 1.0, 9)]
    ramp = LinearSegmentedColormap.from_list("activation", stops)
    bar = figure.colorbar(
        ScalarMappable(Normalize(0.0, top), ramp), ax=list(grid), shrink=0.5, aspect=25
    )
    bar.set_label("activation")
    return figure


def _sample(solution: xr.Dataset, time: float | None) -> int:
    """The sample to draw: the nearest to a time, or where the load is largest."""
    times = solution["time"].values
    good = solution["status"].values == 0
    if not good.any():
        raise InputError("forces: this solution has no sample with a result")
    if time is not None:
        return int(np.argmin(np.where(good, np.abs(times - time), np.inf)))
    sizes = np.linalg.norm(solution["load"].values[:, :3], axis=1)
    if not np.nan_to_num(sizes).any():
        sizes = np.abs(solution["contact_force"].values).sum(axis=1)
    return int(np.argmax(np.where(good, np.nan_to_num(sizes), -1.0)))


def _draw(
    axes: Axes, camera: Camera, drawn: Faces, arrows: list[tuple[Force, np.ndarray, np.ndarray]]
) -> None:
    """The faces, then forces (3,) [N] at places (3,) [m] as arrows; in millimetres."""
    flat, tints = drawn.seen(camera)
    flat = 1e3 * flat
    axes.add_collection(PolyCollection(flat, facecolors=tints, edgecolors=tints, lw=0.3))
    largest = max((float(np.linalg.norm(vector)) for *_, vector in arrows), default=0.0) or 1.0
    low, high = flat.reshape(-1, 2).min(axis=0), flat.reshape(-1, 2).max(axis=0)
    length = LONGEST * float(np.linalg.norm(high - low)) / largest
    ends, free_ends = [low, high], []
    for force, at, vector in arrows:
        into, place_, way = force.into, 1e3 * camera.flat(at), length * camera.flat(vector)
        tail, head = (place_ - way, place_) if into else (place_, place_ + way)
        colour = JOINT if into else BITE
        axes.annotate(
            "", tuple(head), tuple(tail), zorder=4,
            arrowprops={
                "arrowstyle": "-|>", "color": colour, "lw": 2, "shrinkA": 0, "shrinkB": 0,
                "mutation_scale": 12,
            },
        )  # fmt: skip
        ends += [tail, head]
        text = f"{_named(force)}\n{np.linalg.norm(vector):.3g} N"
        free_ends.append((tail if into else head, text, colour, (-way if into else way)[1] < 0))
    for i, (free, text, colour, below) in enumerate(free_ends):
        reach = NEAR * (high - low)[0]
        near = [j for j, end in enumerate(free_ends) if np.linalg.norm(free - end[0]) < reach]
        align = "center" if len(near) == 1 else "right" if i == near[0] else "left"
        at = np.mean([free_ends[j][0] for j in near], axis=0)
        away_ = {"center": 0, "right": -2, "left": 2}[align]
        axes.annotate(
            text, tuple(at), (away_, -3 if below else 3), textcoords="offset points", color=colour,
            ha=align, va="top" if below else "bottom", zorder=5,
            fontsize=mpl.rcParams["legend.fontsize"],
            bbox={"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.8},
        )  # fmt: skip
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    room = ROOM * (high - low).max()
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
    axes.set_aspect("equal", adjustable="box")
    axes.grid(False)
    axis = "XYZ"[int(np.argmax(np.abs(camera.right)))]
    axes.set(xlabel=f"{axis} [mm]", ylabel="Z [mm]")


def _named(force: Force) -> str:
    name = readable(force.owner)
    return name if force.into else f"load{' at ' * bool(name)}{name}"
