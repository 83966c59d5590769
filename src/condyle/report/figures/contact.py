"""Contact forces, and where the contact points run on their surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ...kinematics.batch import evaluate
from ...mechanism.mechanism import Bounds, Contact
from .chains import readable, styles
from .labels import caption
from .panels import bands_of, finish, legend, legend_above, lines
from .registry import plot
from .style import ALERT, GREY, PALETTE, figsize_is_free, narrow, new_figure, nothing_to_draw

if TYPE_CHECKING:
    from ...results.solution import Solution

NO_CONTACTS = "this mechanism has no contacts"
VIEWS = (("from above", "x", "y"), ("from the side", "x", "z"))
VIEW_RATIO = 0.7  # height over width of a view
BESIDE, BELOW, ABOVE = 0.65, 0.75, 0.7  # labels of a view, and the heading [inch]
GRID = 120  # points an axis on which a surface is traced


@plot()
def contact_force(solution: Solution) -> Figure:
    """Force of each contact on the platform along the unit normal, over time."""
    title = "Contact forces on the platform, along the unit normals"
    names = [str(name) for name in solution["contact"].values]
    if not names:
        return nothing_to_draw(title, caption(solution), NO_CONTACTS)
    figure = new_figure(title, caption(solution), 7, 3.2)
    axes = figure.subplots()
    values = solution["contact_force"].values
    bands = bands_of(solution, "contact_force", range(len(names)))
    # Bands of one colour would not be told apart.
    looks = styles(names) if bands is None else None
    lines(axes, solution, values, list(map(readable, names)), looks, bands)
    axes.axhline(0, color=GREY, lw=0.8)
    axes.set_title("negative: against the normal")
    legend(axes, min(3, len(names)))
    finish(np.array([[axes]]), [["force [N]"]])
    return figure


@plot()
def contact_track(solution: Solution) -> Figure:
    """Track of each contact point, from above and from the side, against its bounds."""
    title = "Tracks of the contact points"
    contacts = {contact.name: contact for contact in solution.mechanism.contacts}
    names = [str(name) for name in solution["contact"].values]
    if not names:
        return nothing_to_draw(title, caption(solution), NO_CONTACTS)
    figure = new_figure(title, caption(solution), 0.3 + 3.7 * len(names), 6.0)
    if figsize_is_free():  # the views have a shape of their own
        wide = figure.get_figwidth() / len(names) - BESIDE
        figure.set_figheight(2 * (VIEW_RATIO * wide + BELOW) + (2 if narrow() else 1) * ABOVE)
    grid = figure.subplots(2, len(names), squeeze=False)
    points = solution["contact_point"].values * 1e3
    margins = solution["bound_margin"].values
    for k, name in enumerate(names):
        for axes, (view, across, up) in zip(grid[:, k], VIEWS, strict=True):
            draw_track(axes, points[:, k], margins[:, k], across, up)
            draw_bounds(axes, contacts[name].bounds, across, up)
            frame(axes)
            axes.set(xlabel=f"{across} [mm]", ylabel=f"{up} [mm]")
            axes.set_title(f"{readable(name)}, {view}")
        if contacts[name].surface.known:
            draw_surface(grid[1, k], contacts[name])
    figure.set_layout_engine("compressed", w_pad=0.12)  # made for axes of fixed shape
    legend_above(figure, grid.ravel(), 4 if len(names) > 1 else 2)
    return figure


def frame(axes: Axes) -> None:
    """Equal scales, with room around everything drawn."""
    axes.autoscale_view()
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    width = 1.15 * max(x1 - x0, (y1 - y0) / VIEW_RATIO)
    x, y, height = (x0 + x1) / 2, (y0 + y1) / 2, VIEW_RATIO * width
    axes.set(xlim=(x - width / 2, x + width / 2), ylim=(y - height / 2, y + height / 2))
    axes.locator_params(axis="x", nbins=5)
    axes.set_aspect("equal", adjustable="box")


def draw_track(axes: Axes, points: np.ndarray, margins: np.ndarray, across: str, up: str) -> None:
    """The track of one contact, (N, 3) [mm], in one view; where it is out of bounds stands out."""
    i, j = "xyz".index(across), "xyz".index(up)
    axes.plot(points[:, i], points[:, j], color=PALETTE[0], lw=1.5, label="contact point")
    axes.plot(points[:1, i], points[:1, j], "o", color=PALETTE[0], ms=4, label="start")
    if (outside := margins < 0).any():
        axes.plot(
            points[outside, i], points[outside, j], ".", color=ALERT, ms=4, label="out of bounds"
        )


def draw_bounds(axes: Axes, bounds: Bounds, across: str, up: str) -> None:
    """A rectangle, or two lines where only one of the two axes is bounded."""
    intervals = [getattr(bounds, name) for name in (across, up)]
    look: dict[str, Any] = {"color": GREY, "lw": 1.0, "ls": (0, (4, 2)), "label": "bounds"}
    if all(interval is not None for interval in intervals):
        (x0, x1), (y0, y1) = np.array(intervals) * 1e3
        axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, **look))
        return
    for interval, line in zip(intervals, (axes.axvline, axes.axhline), strict=True):
        for value in interval or ():
            line(value * 1e3, **look)
            look.pop("label", None)


def draw_surface(axes: Axes, contact: Contact) -> None:
    """Where the centre of the ball can be, at the y of the home point and within the view."""
    (x0, x1), (z0, z1) = axes.get_xlim(), axes.get_ylim()
    x, z = np.meshgrid(np.linspace(x0, x1, GRID), np.linspace(z0, z1, GRID))
    p = ca.SX.sym("p", 3)
    phi = ca.Function("phi", [p], [contact.offset_surface.phi(p)])
    where = np.column_stack([x.ravel(), np.full(x.size, contact.point[1] * 1e3), z.ravel()]) / 1e3
    value = evaluate(phi, where)[0].reshape(x.shape)
    value[~np.isfinite(value)] = np.nan  # a ball far from its wall
    axes.contour(x, z, value, levels=[0.0], colors=PALETTE[2], linewidths=1.0, zorder=1)
    label = "surface at the home y"
    if contact.ball_radius is not None:
        label += ", less the ball's radius"
    axes.plot([], [], color=PALETTE[2], lw=1.0, label=label)
