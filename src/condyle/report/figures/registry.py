"""The figures by name. A file that registers one is all that a new figure needs:

@plot()
def power(solution: Solution) -> Figure:
    '''Power of each actuator over time.'''
    made = new_figure("Power of the actuators", caption(solution), 7.5, 3.0)
    ...

Files in this folder are found by themselves; a package elsewhere names its module as an entry
point of the group `condyle.figures`.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from typing import Concatenate, ParamSpec, TypeVar

from matplotlib.figure import Figure

from .style import house

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


def find_figures() -> None:
    """Import every file that registers figures, those of this folder first."""
    folder = __name__.rpartition(".")[0]
    for module in pkgutil.iter_modules(import_module(folder).__path__):
        import_module(f"{folder}.{module.name}")
    for point in entry_points(group=GROUP):
        point.load()
    found = sorted(PLOTS.items())  # in whatever order the files were imported
    PLOTS.clear()
    PLOTS.update(found)
