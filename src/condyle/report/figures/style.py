"""The house style of the figures: sizes, colours, line styles and captions.

Figures are plain `matplotlib.figure.Figure` objects. No state of pyplot is touched, so they can be
drawn in a script, a notebook or a server alike.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from io import BytesIO
from pathlib import PurePath
from string import ascii_lowercase
from textwrap import fill
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.text import Text
from matplotlib.transforms import ScaledTranslation

from ...analysis.paper import is_stand_in, is_synthetic
from ...errors import InputError, did_you_mean
from ...results.failed_samples import complete_dataset

if TYPE_CHECKING:
    import xarray as xr

# Okabe and Ito's colours, distinct to colour-blind readers; without yellow, which pales on white.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = (
    "-",
    (0, (4, 2)),
    (0, (1, 1.5)),
    (0, (5, 1.5, 1, 1.5)),
    (0, (8, 2)),
    (0, (5, 1.5, 1, 1.5, 1, 1.5)),
)
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


JOURNAL: Any = STYLE | {
    "savefig.dpi": 600,
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.0,
    "legend.handletextpad": 0.5,
    "figure.titlesize": 8,
    "lines.linewidth": 1.0,
    "axes.linewidth": 0.6,
}


@dataclass(frozen=True)
class Paper:
    """Settings of matplotlib, and the width [mm] and part of the height that figures get."""

    settings: Any
    width: float | None = None
    height: float = 1.0


# One or two columns of a journal; the screen takes each figure's own size.
STYLES = {
    "screen": Paper(STYLE),
    "journal": Paper(JOURNAL, 85.0, 0.75),
    "journal-wide": Paper(JOURNAL, 175.0, 0.75),
}
INCH = 25.4
SCREEN_DPI = 100
NARROW = 120.0  # [mm]
DECADES = 100.0  # greatest over least value; below it a logarithm has too few labels
MARGIN = 44  # of a panel, for its numbers and label [pt]


@dataclass(frozen=True)
class Wishes:
    """What a caller asks of a figure, whichever it is."""

    figsize: tuple[float, float] | None = None
    title: bool = True
    paper: Paper = STYLES["screen"]


PLAIN = Wishes()
_wishes: ContextVar[Wishes] = ContextVar("wishes", default=PLAIN)


def look(i: int, turn: int | None = None) -> dict[str, Any]:
    """Colour i of the palette; the dashes change with it, or are those of `turn`."""
    dashes = i if turn is None else turn
    return {"color": PALETTE[i % len(PALETTE)], "linestyle": DASHES[dashes % len(DASHES)]}


# For three components; the third with gaps, since alpha and gamma nearly coincide in chewing.
XYZ = (look(0, 0), look(1, 2), look(-1) | {"linestyle": (0, (3, 3))})


def house(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Draw in the house style, whatever the caller's settings are.

    Adds to the arguments of `draw`:

    Args:   figsize: width and height [inch].
            title: whether the heading, and the line that says where the data come from, are drawn;
                without them both belong into the caption of whoever prints the figure.
            letters: whether panels are marked (a), (b), ...
            style: of `STYLES`: "screen"; "journal", 85 mm wide with letters of 8 pt, or
                "journal-wide", 175 mm, which figures of many columns take anyway.
    Raises: InputError: if there is no such style.
    """

    @wraps(draw)
    def styled(
        *args: Any,
        figsize: tuple[float, float] | None = None,
        title: bool = True,
        letters: bool = False,
        style: str = "screen",
        **kwargs: Any,
    ) -> Figure:
        if style not in STYLES:
            raise InputError(f'no style "{style}" of figures.{did_you_mean(style, STYLES)}')
        paper = STYLES[style]
        before = _wishes.set(Wishes(figsize, title, paper))
        try:
            with mpl.rc_context(paper.settings), complete_dataset():
                figure = draw(*args, **kwargs)
                if letters:
                    mark_panels(figure)
                if narrow():
                    make_room(figure)
                names_as_text(figure)
                return figure
        finally:
            _wishes.reset(before)

    return styled


def mathematics(text: str) -> str:
    """J_A and J_W as they are printed."""
    return re.sub(r"\bJ_([AW])\b", r"$J_\1$", text)


def labelled(what: str, unit: str) -> str:
    """'force [N]'; a plain number, of unit 1, has no unit."""
    return mathematics(what if unit == "1" else f"{what} [{unit}]")


def names_as_text(figure: Figure) -> None:
    """Print a $ that stands in a name: only `mathematics` writes formulas."""
    for text in figure.findobj(Text):
        if "$" in re.sub(r"\$J_[AW]\$|\\\$", "", text.get_text()):
            text.set_parse_math(False)


def use_decades(axes: Axes, values: np.ndarray) -> None:
    """Make a scale logarithmic where positive values differ by more than `DECADES`."""
    sizes = values[np.isfinite(values) & (values > 0)]
    if sizes.size and sizes.max() > DECADES * sizes.min():
        axes.set_yscale("log")


def figsize_is_free() -> bool:
    """Whether the caller leaves the size of the figure to it."""
    return _wishes.get().figsize is None


def narrow() -> bool:
    """Whether the figure that is being drawn is for one column of a page."""
    width = _wishes.get().paper.width
    return width is not None and width < NARROW


def on_screen() -> bool:
    """Whether the figure that is being drawn is for a screen."""
    return _wishes.get().paper.width is None


def paper_height() -> float:
    """The part of its height that the figure being drawn gets."""
    return _wishes.get().paper.height


def break_titles(figure: Figure) -> None:
    """Break titles to the width of their panels."""
    size = mpl.rcParams["axes.titlesize"]
    for axes in figure.axes:
        spec = axes.get_subplotspec()
        columns = 1 if spec is None else spec.get_gridspec().ncols
        room = 72 * figure.get_figwidth() / columns - MARGIN
        title = fill(axes.get_title(loc="left"), max(int(room / (0.58 * size)), 10))
        axes.set_title(title, loc="left", pad=4)


def make_room(figure: Figure) -> None:
    """Break titles to the width of their panels, and put legends above them."""
    break_titles(figure)
    size = mpl.rcParams["axes.titlesize"]
    for axes in figure.axes:
        title = axes.get_title(loc="left")
        if (legend := axes.get_legend()) is not None:
            lines = title.count("\n") + 1 if title else 0
            up = ScaledTranslation(0.0, 1.3 * size * lines / 72, figure.dpi_scale_trans)
            legend.set_bbox_to_anchor((1.0, 1.0), transform=axes.transAxes + up)


def mark_panels(figure: Figure) -> None:
    """Put (a), (b), ... before the titles of the panels."""
    for i, axes in enumerate(figure.axes):
        letter = ascii_lowercase[i % 26] * (1 + i // 26)
        axes.set_title(f"({letter}) {axes.get_title(loc='left')}".rstrip(), loc="left")


class NotebookFigure(Figure):
    """A figure without pyplot that is its picture as the last line of a notebook's cell."""

    def _repr_png_(self) -> bytes:
        return png(self)


def png(figure: Figure) -> bytes:
    """A figure as an image in memory, as wide as a screen needs it."""
    image = BytesIO()
    figure.savefig(image, format="png", dpi=SCREEN_DPI)
    return image.getvalue()


def new_figure(title: str, caption: str, width: float, height: float, columns: int = 1) -> Figure:
    """An empty figure [inch] with a title, and a caption that says where its data come from.

    The caller's wishes go before.

    Args: columns: of panels; more than two do not fit into one column of a journal.
    """
    wishes = _wishes.get()
    paper = STYLES["journal-wide"] if narrow() and columns > 2 else wishes.paper
    size = (width if paper.width is None else paper.width / INCH, height * paper.height)
    figure = NotebookFigure(figsize=wishes.figsize or size, layout="constrained")
    if wishes.title:
        letters = int(72 * figure.get_figwidth() / (0.6 * mpl.rcParams["figure.titlesize"]))
        figure.suptitle(fill(title, letters), x=0.01, ha="left")
        set_caption(figure, caption.replace("$", r"\$"))
    return figure


def set_caption(figure: FigureBase, text: str) -> None:
    """Write a caption; to wrap it matplotlib reads formulas, whatever `parse_math` says."""
    size = mpl.rcParams["font.size"] - 2
    figure.supxlabel(text, x=0.01, ha="left", fontsize=size, color=GREY, wrap=True)


def extend_caption(figure: FigureBase, sentences: Sequence[str]) -> None:
    """Add sentences to the caption of a figure that has one."""
    if text := figure.get_supxlabel():
        more = [mathematics(one.replace("$", r"\$")) for one in sentences]
        set_caption(figure, " ".join([text, *more]))


class EmptyFigureError(InputError):
    """The data have nothing of what a figure shows."""


TIME = "time [s]"
MOST_REASONS = 3  # why samples have no result, in a caption
COORDINATE = {"alpha": "α", "beta": "β", "gamma": "γ"}


def written(coordinate: str) -> str:
    """A coordinate, or its rate, as formulas have it."""
    name = coordinate.rstrip("′")
    return COORDINATE.get(name, name) + coordinate[len(name) :]


def caption(solution: xr.Dataset) -> str:
    """Where the data come from, and what they must not be taken for."""
    options, name = solution.condyle.options, solution.attrs["mechanism_name"]
    stand_in = is_stand_in(solution.condyle.mechanism)
    invented = [what for what in ("motion", "load") if is_synthetic(options[what])]
    parts = [f"Mechanism {name}" + (": stand-in, not the authors' robot" if stand_in else "")]
    if invented:
        parts.append(f"synthetic {' and '.join(invented)}, not the paper's")
    parts += [
        f"{what}: {PurePath(options[what]).name}"
        for what in ("motion", "load")
        if what not in invented
    ]
    if "bands" in solution.attrs:
        bands = json.loads(solution.attrs["bands"])
        of = f"{bands['variants']} {bands.get('of', 'variants')}"
        parts.append(f"bands: 5 to 95 and 25 to 75 % of {of}")
    reasons = dict.fromkeys(one.text for one in solution.condyle.failures)
    grey = [f" Grey: no result ({', '.join(list(reasons)[:MOST_REASONS])})."] if reasons else []
    return "; ".join(parts) + "." + "".join(grey)
