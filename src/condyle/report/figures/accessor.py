"""`solution.plot`: one method a figure."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from matplotlib.figure import Figure
from xarray.plot.accessor import DatasetPlotAccessor

from .registry import PLOTS


def _method(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    @wraps(draw)
    def method(self: SolutionPlots, *args: Any, **kwargs: Any) -> Figure:
        return draw(self._ds, *args, **kwargs)

    return method


class SolutionPlots(DatasetPlotAccessor):
    """Figures of a solution: `solution.plot.torque()` returns a matplotlib Figure.

    xarray's own plots of datasets, such as `solution.plot.scatter`, stay where they were.
    """

    __slots__ = ()

    contact_force = _method(PLOTS["contact_force"])
    contact_track = _method(PLOTS["contact_track"])
    jacobian = _method(PLOTS["jacobian"])
    joint = _method(PLOTS["joint"])
    load = _method(PLOTS["load"])
    motion = _method(PLOTS["motion"])
    path = _method(PLOTS["path"])
    share = _method(PLOTS["share"])
    singularity = _method(PLOTS["singularity"])
    torque = _method(PLOTS["torque"])
