"""The section of the page that shows a sweep: its pictures and tables."""

from __future__ import annotations

import base64
from io import BytesIO
from typing import TYPE_CHECKING

from ...extras import require
from .html import Markup, table, tag

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from ...results.solution import Solution

DPI = 110


def sweep_section(found: xr.Dataset | None) -> Markup:
    """Pictures and tables of a sweep; nothing without one."""
    if found is None:
        return Markup("")
    require("matplotlib", "figures")
    from ..figures.sweep_figures import sweep_plots
    from ..tables.sweep_tables import sweep_tables

    pictures = [
        tag("p", _image(draw(found), (draw.__doc__ or "").splitlines()[0]))
        for draw in sweep_plots(found).values()
    ]
    tables = [table(t.columns, t.rows, t.title, t.notes) for t in sweep_tables(found)]
    return tag("section", tag("h2", "Sweep"), *pictures, *tables, id="sweep")


def bands_section(solution: Solution) -> Markup:
    """Efforts and contact forces with their bands, where the solution has some."""
    if "bands" not in solution.attrs:
        return Markup("")
    require("matplotlib", "figures")
    from ..figures import PLOTS

    names = ["torque"] + ["contact_force"] * bool(solution.sizes["contact"])
    pictures = [tag("p", _image(PLOTS[n](solution), f"Bands of {n}")) for n in names]
    return tag("section", tag("h2", "Bands over variants"), *pictures, id="bands")


def _image(figure: Figure, meaning: str) -> Markup:
    """A picture within the page: it needs no file beside it."""
    content = BytesIO()
    figure.savefig(content, format="png", dpi=DPI)
    data = base64.b64encode(content.getvalue()).decode()
    source = Markup(f"data:image/png;base64,{data}")
    return Markup(f'<img src="{source}" alt="{meaning}" style="max-width:100%">')
