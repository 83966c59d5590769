"""`solution.plot`: one method a figure."""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from typing import Any

from matplotlib.figure import Figure
from xarray.plot.accessor import DatasetPlotAccessor

from ...errors import did_you_mean
from .registry import PLOTS


class SolutionPlots(DatasetPlotAccessor):
    """Figures of a solution: `solution.plot.torque()` returns a matplotlib Figure.

    There is a method for every figure that is registered. xarray's own plots of datasets, such as
    `solution.plot.scatter`, stay where they were.
    """

    __slots__ = ()

    def __getattr__(self, name: str) -> Callable[..., Figure]:
        if name not in PLOTS:
            known = did_you_mean(name, PLOTS)
            raise AttributeError(f'a solution has no figure "{name}".{known}')
        draw, solution = PLOTS[name], self._ds

        def method(*args: Any, **kwargs: Any) -> Figure:
            return draw(solution, *args, **kwargs)

        return update_wrapper(method, draw)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *PLOTS})
