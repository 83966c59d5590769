"""The figures by name, those of panels (`condyle.report.panel_list`) and others:

@plot()
def power(solution: xr.Dataset) -> Figure:
    '''Power of each actuator over time.'''
    made = new_figure("Power of the actuators", caption(solution), 7.5, 3.0)
    ...

A package elsewhere names its module as an entry point of the group `condyle.figures`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from matplotlib.figure import Figure

from ...errors import did_you_mean
from ..panel import PanelGroup, known_groups, listeners
from .style import house

if TYPE_CHECKING:
    import xarray as xr

P = ParamSpec("P")
S = TypeVar("S")

# Name -> function of a solution; the first line of its docstring says what it shows.
PLOTS: dict[str, Callable[..., Figure]] = {}
GROUP = "condyle.figures"


def plot(
    name: str | None = None,
) -> Callable[[Callable[Concatenate[S, P], Figure]], Callable[..., Figure]]:
    """Draw in the house style, and register the figure as `name`, by default the function's.

    The function takes a solution; what callers can ask of every figure (`figsize`, `title`,
    `letters`, `style`) is added to its own arguments.
    """

    def register(draw: Callable[Concatenate[S, P], Figure]) -> Callable[..., Figure]:
        styled = house(draw)
        PLOTS[name or draw.__name__] = styled
        return styled

    return register


def find_figures(figure_of: Callable[[PanelGroup], Any]) -> None:
    """Register the figures of panels, now and later, and those of other packages."""
    for group in known_groups():
        figure_of(group)
    listeners.append(figure_of)
    for point in entry_points(group=GROUP):
        point.load()
    found = sorted(PLOTS.items())  # in whatever order the files were imported
    PLOTS.clear()
    PLOTS.update(found)


class SolutionPlots:
    """Figures of a solution: `solution.condyle.plot.effort()` returns a matplotlib Figure.

    There is a method for every figure that is registered.
    """

    def __init__(self, solution: xr.Dataset) -> None:
        self._solution = solution

    def __getattr__(self, name: str) -> Callable[..., Figure]:
        if name not in PLOTS:
            known = did_you_mean(name, PLOTS)
            raise AttributeError(f'a solution has no figure "{name}".{known}')
        draw, solution = PLOTS[name], self._solution

        def method(*args: Any, **kwargs: Any) -> Figure:
            return draw(solution, *args, **kwargs)

        return update_wrapper(method, draw)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *PLOTS})
