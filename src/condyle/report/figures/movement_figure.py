"""Movements of a jaw as clinics draw them: envelope, Gothic arch, and speed over gape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...analysis.session.incisor import POINT, has_incisor, way_of
from .registry import plot
from .style import DARK, EmptyFigureError, caption, narrow, new_figure

if TYPE_CHECKING:
    import xarray as xr


@plot()
def movement(solution: xr.Dataset) -> Figure:
    """Path of the incisal point in the sagittal and horizontal planes of {S}, and its speed."""
    mechanism = solution.condyle.mechanism
    if not has_incisor(mechanism):
        raise EmptyFigureError("no figure movement: this machine has no point incisor")
    t = solution["time"].values
    way = 1e3 * way_of(mechanism.platform.points[POINT], solution["pose"].values)
    speed = np.gradient(way[:, 2], t) if len(t) > 1 else np.zeros(len(t))
    forward, left, gape = way.T
    column = narrow()
    size = (7.0, 9.0) if column else (10.0, 3.6)
    figure = new_figure("Movement of the incisal point", caption(solution), *size)
    envelope, arch, velocity = figure.subplots(*((3, 1) if column else (1, 3))).ravel()
    envelope.plot(forward, -gape, color=DARK)
    envelope.set(xlabel="forwards [mm]", ylabel="upwards [mm]")
    envelope.set_title("envelope, sagittal")
    envelope.set_aspect("equal", "datalim")
    arch.plot(-left, forward, color=DARK)
    arch.set(xlabel="to the right [mm]", ylabel="forwards [mm]")
    arch.set_title("Gothic arch, horizontal")
    arch.set_aspect("equal", "datalim")
    velocity.plot(gape, speed, color=DARK)
    velocity.set(xlabel="gape [mm]", ylabel="opening speed [mm/s]")
    velocity.set_title("speed over gape")
    return figure
