"""The figures by name, those of panels (`condyle.report.panel_list`) and others:

@plot()
def power(solution: xr.Dataset) -> Figure:
    '''Power of each actuator over time.'''
    made = new_figure("Power of the actuators", caption(solution), 7.5, 3.0)
    ...

A package elsewhere names its module as an entry point of the group `condyle.figures`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial, update_wrapper
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from matplotlib.figure import Figure

from ...errors import did_you_mean
from ..panel import PanelGroup, known_groups, listeners
from .style import EmptyFigureError, house, png

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
    `letters`, `style`) is added to its own arguments. It raises EmptyFigureError for a solution
    that has nothing of it, which is passed over where all figures are drawn.
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


class Plots:
    """Figures of a dataset: `dataset.condyle.plot.effort()` returns a matplotlib Figure.

    There is a method for every figure. As the last line of a notebook's cell it is the first one.
    """

    def __init__(
        self, dataset: xr.Dataset, figures: Mapping[str, Callable[..., Figure]], first: str
    ) -> None:
        self._dataset, self._figures, self._first = dataset, figures, first

    def __getattr__(self, name: str) -> Callable[..., Figure]:
        if name.startswith("_") or name not in self._figures:
            kind, known = self._dataset.condyle.kind, did_you_mean(name, self._figures)
            raise AttributeError(f'a {kind} has no figure "{name}".{known}')
        draw = self._figures[name]
        return update_wrapper(partial(draw, self._dataset), draw)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._figures})

    def __iter__(self) -> Iterator[str]:
        return iter(self._figures)

    def _repr_png_(self) -> bytes | None:
        with suppress(EmptyFigureError):
            return png(getattr(self, self._first)())
        return None


def solution_plots(solution: xr.Dataset) -> Plots:
    """Figures of a solution."""
    known_groups()  # what was registered since, too
    return Plots(solution, PLOTS, "effort")
