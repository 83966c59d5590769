"""Natural frequencies of a mechanism at home, and how it moves in each of its modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from ...model.model import Model
from ...results.vibrations import HomeModes, of_amplitude, solution_modes
from ...status import Status
from ..scene import VIEWS, Camera, faces_of, parts_of, place
from .registry import plot
from .style import DARK, GREY, PALETTE, EmptyFigureError, caption, house, narrow, new_figure

if TYPE_CHECKING:
    import xarray as xr

AMPLITUDES = 0.15, 0.08, 0.04, 0.02  # largest part of a shape that is drawn, the first reachable
PALE = 0.35  # opacity of the other end of the swing
MOST_ACROSS = 3  # pictures side by side


@plot()
def modes(solution: xr.Dataset) -> Figure:
    """Natural frequencies at home, held against gravity, and the two ends of each mode's swing."""
    if (found := solution_modes(solution)) is None:
        raise EmptyFigureError("no figure modes: no part of this mechanism gives")
    return _drawn(*found, caption(solution))


@house
def modes_figure(model: Model, found: HomeModes) -> Figure:
    """Frequencies, and a picture of each mode, of a model at home.

    Raises: EmptyFigureError: where modes are not known.
    """
    return _drawn(
        model,
        found,
        f"Mechanism {model.mechanism.name}; held against gravity. Swings are much enlarged.",
    )


def _drawn(model: Model, found: HomeModes, text: str) -> Figure:
    hertz = [value for value in found.data["frequency"] or () if value is not None]
    if not hertz:
        raise EmptyFigureError("no figure modes: they are not known at this home")
    columns = 1 if narrow() else min(MOST_ACROSS, -(-len(hertz) // 2))
    rows = -(-len(hertz) // columns)
    heights = [0.5 + 0.25 * len(hertz), *[2.6] * rows]
    figure = new_figure("Modes at home", text, 3.2 * columns, sum(heights) + 0.8, columns)
    grid = figure.add_gridspec(1 + rows, columns, height_ratios=heights)
    _bars(figure.add_subplot(grid[0, :]), hertz, found.data["damping"])
    for i, value in enumerate(hertz):
        axes = figure.add_subplot(grid[1 + i // columns, i % columns])
        axes.set_title(f"{i + 1}: {value:.4g} Hz")
        _swing(axes, model, np.array(found.data["shape"][i]))
    return figure


def _bars(axes: Axes, hertz: list[float], damping: list[float | None]) -> None:
    places = list(range(1, len(hertz) + 1))
    axes.barh(places, hertz, height=0.5, color=PALETTE[0])
    for mode, value, ratio in zip(places, hertz, damping, strict=False):
        text = f" {value:.4g}" + (f", damping {ratio:.1%}" if ratio else "")
        axes.text(max(value, 0.0), mode, text, va="center", fontsize=7, color=DARK)
    axes.set(xlabel="frequency [Hz]", ylabel="mode", ylim=(len(hertz) + 0.6, 0.4))
    axes.set_yticks(places)
    axes.margins(x=0.25)


def _swing(axes: Axes, model: Model, shape: np.ndarray) -> None:
    """Both ends of a mode's swing, as far as the chains reach."""
    for amplitude in AMPLITUDES:
        end = of_amplitude(model, shape, amplitude)
        found = model.inverse_kinematics([-end, end])
        if (found.status == Status.ok).all():
            break
    else:
        axes.text(0.5, 0.5, "out of reach", ha="center", color=GREY, transform=axes.transAxes)
        axes.axis("off")
        return
    scene = place(model.mechanism, found.pose, found.joint)
    parts = parts_of(model.mechanism, scene)
    camera = Camera.of(*VIEWS[parts.view])
    corners = []
    for k, opacity in enumerate((PALE, 1.0)):
        flat, tints = faces_of(parts, scene, k).seen(camera)
        tints[:, 3] *= opacity
        flat = 1e3 * flat
        axes.add_collection(PolyCollection(list(flat), facecolors=tints, lw=0.0))
        corners.append(flat.reshape(-1, 2))
    low, high = np.vstack(corners).min(axis=0), np.vstack(corners).max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_aspect("equal")
    axes.axis("off")
