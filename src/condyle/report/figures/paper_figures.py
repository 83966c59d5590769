"""Figures 5 to 9 of the paper."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from ..naming import LOAD_PARTS
from ..panel import Curve
from ..panel_list import motion, torque
from .caption import caption
from .drawing import draw_grid, draw_pairs
from .platform_path import draw_path, landmark
from .registry import PLOTS
from .style import house, new_figure

if TYPE_CHECKING:
    from ...analysis.comparison import Comparison
    from ...analysis.runs import Run
    from ...results.solution import Solution

PAPER_ORDER = ("platform", "cranks", "couplers")


@house
def figure_5(solution: Solution) -> Figure:
    """The paper's Fig. 5: path and coordinates."""
    title = f"Motion of the platform: path of {landmark(solution)[0]}, and coordinates"
    figure = new_figure(title, caption(solution), 10, 9)
    [above], [below] = figure.subfigures(2, 1, squeeze=False, height_ratios=(1, 2.4))
    draw_path(above, solution)
    draw_grid(below, solution, list(motion(solution)))
    return figure


def figure_6(solution: Solution) -> Figure:
    """The paper's Fig. 6: the diagonal of J_A."""
    return PLOTS["jacobian"](solution)


def figure_7(solution: Solution) -> Figure:
    """The paper's Fig. 7: the bite force."""
    return PLOTS["load"](solution)


@house
def figure_8(comparison: Comparison) -> Figure:
    """The paper's Fig. 8: torques of Model 1, and how far other models are from them."""
    solution = comparison.solution
    first, others = first_and_others(comparison)
    columns = {first.label: first.torque}
    columns |= {f"{first.label} − {one.label}": first.torque - one.torque for one in others}
    names = [str(name) for name in solution["chain"].values]
    panels = {c.label: replace(p, limits=()) for p in torque(solution) for c in p.curves}
    cells = {
        title: {n: (Curve(n, "", values[:, i]), panels[n]) for i, n in enumerate(names)}
        for title, values in columns.items()
    }
    title = f"Efforts by {first.label}, and differences to other models"
    return draw_pairs(title, solution, cells, same=True)


def figure_9(solution: Solution) -> Figure:
    """The paper's Fig. 9: end effector, cranks and couplers, without the load."""
    there = [str(part) for part in solution["part"].values if part not in LOAD_PARTS]
    first = [part for part in PAPER_ORDER if part in there]
    return PLOTS["share"](solution, first + [part for part in there if part not in first])


def first_and_others(comparison: Comparison) -> tuple[Run, list[Run]]:
    """Model 1 (momentum, direct) and the two the paper sets against it, as far as there are."""
    wanted = [
        ("momentum", "direct"),
        ("momentum", "core"),
        ("lagrange", "direct"),
        ("lagrange", "core"),
    ]
    found = [run for key in wanted if (run := comparison.run(*key)) is not None]
    found += [run for run in comparison.runs if run not in found]
    return found[0], found[1:3]
