"""How far the motion is from singularities (the paper's Fig. 6: the diagonal of J_A)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...kinematics.singularities import NEAR_SINGULAR
from .chains import groups, heading, readable, styles
from .labels import caption
from .panels import finish, legend, legend_beside, lines
from .registry import plot
from .style import ALERT, DASHES, new_figure

if TYPE_CHECKING:
    from ...results.solution import Solution

# Joint unit -> unit of J_A on the axis, from m^2 per joint unit, and the factor to it.
J_A_UNITS = {"rad": ("mm²/rad", 1e6), "m": ("mm", 1e3)}


@plot()
def jacobian(solution: Solution) -> Figure:
    """Diagonal of J_A, eq. (26): a chain is at an inverse singularity where its entry is zero."""
    names = [str(name) for name in solution["chain"].values]
    units = [str(unit) for unit in solution["joint_unit"].values]
    panels = groups(names, units)
    figure = new_figure("Diagonal of $J_A$", caption(solution), 7.5, 0.9 + 1.6 * len(panels))
    grid = figure.subplots(len(panels), 1, sharex=True, squeeze=False)
    labels = []
    for axes, members in zip(grid[:, 0], panels, strict=True):
        unit, factor = J_A_UNITS.get(units[members[0]], (f"m²/{units[members[0]]}", 1.0))
        own = [names[i] for i in members]
        values = solution["J_A"].values[:, members] * factor
        lines(axes, solution, values, list(map(readable, own)))
        legend(axes, 2)
        axes.set_title(heading(own))
        labels.append([f"$J_A$ [{unit}]"])
    finish(grid, labels)
    return figure


@plot()
def singularity(solution: Solution) -> Figure:
    """Dimensionless measures: transmission of each chain, singular values of J_W, their ratio."""
    figure = new_figure("Distance from singularities", caption(solution), 8.5, 7)
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    names = [str(name) for name in solution["chain"].values]
    lines(top, solution, solution["transmission"].values, list(map(readable, names)), styles(names))
    top.set_title("transmission of each chain: ±1 is best, 0 an inverse singularity")

    sigma = solution["J_W_sigma"].values
    ordinals = [f"$\\sigma_{i + 1}$" for i in range(sigma.shape[1])]
    lines(middle, solution, sigma, ordinals)
    middle.set_title("singular values of the dimensionless $J_W$")

    ratio = solution["singularity_ratio"].values[:, None]
    lines(bottom, solution, ratio, ["smaller ratio"])
    bottom.axhline(NEAR_SINGULAR, color=ALERT, lw=1, ls=DASHES[1], label=f"near: {NEAR_SINGULAR:g}")
    bottom.set_title("smallest over largest, of the transmissions or of the singular values")
    for axes in (top, middle, bottom):
        legend_beside(axes)
    for axes in (middle, bottom):
        axes.set_yscale("log")
    finish(np.array([[top], [middle], [bottom]]), [["transmission [1]"], ["σ [1]"], ["ratio [1]"]])
    return figure
