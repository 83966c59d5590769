"""The house style of the figures: sizes, colours and line styles, and figures that carry them.

Figures are plain `matplotlib.figure.Figure` objects. No state of pyplot is touched, so they can be
drawn in a script, a notebook or a server alike.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec

import matplotlib as mpl
from cycler import cycler
from matplotlib.figure import Figure

P = ParamSpec("P")

# Okabe and Ito's colours, told apart by colour-blind readers; without yellow, which pales on white.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", (0, (4, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)))
GREY = "#666666"
DARK = "#333333"
ALERT = "#D55E00"

STYLE: Any = {
    "figure.dpi": 100,
    "savefig.dpi": 160,
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.labelsize": 9,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "figure.titlesize": 11,
    "figure.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.xmargin": 0.0,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "axes.prop_cycle": cycler(color=PALETTE),
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-2, 4),
    "svg.hashsalt": "condyle",  # the same figure gives the same file
}


def look(i: int, turn: int | None = None) -> dict[str, Any]:
    """Colour i of the palette; the dashes change with it, or are those of `turn`."""
    dashes = i if turn is None else turn
    return {"color": PALETTE[i % len(PALETTE)], "linestyle": DASHES[dashes % len(DASHES)]}


# For three components; the third dashed, since alpha and gamma nearly coincide in chewing.
XYZ = (look(0, 0), look(1, 0), look(-1, 1))


def house(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draw in the house style, whatever the caller's settings are."""

    @wraps(draw)
    def styled(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context(STYLE):
            return draw(*args, **kwargs)

    return styled


def new_figure(title: str, caption: str, width: float, height: float) -> Figure:
    """An empty figure [inch] with a title, and a caption that says where its data come from."""
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.suptitle(title, x=0.01, ha="left")
    figure.supxlabel(caption, x=0.01, ha="left", fontsize=7, color=GREY)
    return figure


def nothing_to_draw(title: str, caption: str, why: str) -> Figure:
    """A figure that says why it is empty."""
    figure = new_figure(title, caption, 6, 1.6)
    axes = figure.add_subplot()
    axes.axis("off")
    axes.text(0.5, 0.5, why, ha="center", va="center", color=GREY)
    return figure
