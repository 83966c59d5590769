"""Load on the platform (the paper's Fig. 7: the bite force)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .chains import readable
from .labels import caption
from .panels import finish, legend, lines
from .registry import plot
from .style import XYZ, new_figure

if TYPE_CHECKING:
    from ...results.solution import Solution


@plot()
def load(solution: Solution) -> Figure:
    """Force on the platform over time, and its moment where there is one."""
    wrench = solution["load"]
    point = solution.options["load_point"]
    kinds = [("force", "N", ["Fx", "Fy", "Fz"])]
    if wrench.sel(component=["Mx", "My", "Mz"]).values.any():
        kinds.append(("moment", "N m", ["Mx", "My", "Mz"]))
    title = "Load on the platform" + (f" at {readable(point)}" if point else "")
    figure = new_figure(title, caption(solution), 7, 1.0 + 2.0 * len(kinds))
    grid = figure.subplots(len(kinds), 1, sharex=True, squeeze=False)
    for axes, (_, _, names) in zip(grid[:, 0], kinds, strict=True):
        values = np.asarray(wrench.sel(component=names).values)
        lines(axes, solution, values, names, XYZ)
        legend(axes, 3)
    finish(grid, [[f"{kind} [{unit}]"] for kind, unit, _ in kinds])
    return figure
