"""What each part of the mechanism needs of the efforts (the paper's Fig. 9)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from ...errors import InputError, did_you_mean
from ..words import LOAD_PARTS, part_word, parts_in_use
from .chains import groups, readable
from .labels import caption
from .panels import finish, legend_beside, lines
from .registry import plot
from .style import new_figure
from .torque import MOST_ROWS, chains_of, effort_label, scale_by_unit

if TYPE_CHECKING:
    from ...results.solution import Solution

PAPER_ORDER = ("platform", "cranks", "couplers")


@plot()
def share(solution: Solution, parts: Sequence[str] | None = None) -> Figure:
    """Efforts by part: a column a part, a row a pair of chains.

    Args: parts: names; by default all that there are.
    """
    parts = [named_part(solution, part) for part in parts or parts_in_use(solution)]
    names, units = chains_of(solution)
    panels = groups(names, units)
    figure = new_figure(
        "Efforts by the part of the mechanism that needs them",
        caption(solution),
        max(6.0, 1.8 + 2.7 * len(parts)),
        1.1 + (1.7 if len(panels) <= MOST_ROWS else 1.0) * len(panels),
        len(parts),
    )
    grid = figure.subplots(len(panels), len(parts), sharex=True, squeeze=False)
    for row, members in zip(grid, panels, strict=True):
        own = [readable(names[i]) for i in members]
        for axes, part in zip(row, parts, strict=True):
            values = solution["share"].sel(part=part).values[:, members]
            lines(axes, solution, values, own)
        legend_beside(row[-1])
    for axes, part in zip(grid[0], parts, strict=True):
        axes.set_title(part_word(part), pad=20)
    scale_by_unit(grid, panels, units)
    finish(grid, [[effort_label(units[m[0]])] + [""] * (len(parts) - 1) for m in panels])
    return figure


def figure_9(solution: Solution) -> Figure:
    """The paper's Fig. 9: end effector, cranks and couplers, without the load."""
    there = [str(part) for part in solution["part"].values if part not in LOAD_PARTS]
    first = [part for part in PAPER_ORDER if part in there]
    return share(solution, first + [part for part in there if part not in first])


def named_part(solution: Solution, part: str) -> str:
    """The part in the solution that a caller means; the load has two names."""
    there = [str(name) for name in solution["part"].values]
    meant = [name for name in there if name == part or {name, part} <= set(LOAD_PARTS)]
    if not meant:
        raise InputError(f'no part "{part}".{did_you_mean(part, there)}')
    return meant[0]
