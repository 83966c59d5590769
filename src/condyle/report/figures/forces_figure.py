"""A jaw from the front and from the side at one instant: muscles, and forces as arrows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure

from ...errors import InputError
from ..naming import of_muscles, readable
from ..panel_list import activation_rows, activation_top
from ..scene import ROLES, VIEWS, activation_colour, band_mesh, contact_normals, parts_of, place
from .registry import plot
from .style import DARK, caption, narrow, new_figure, nothing_to_draw

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

NO_MUSCLES = "this machine has no muscles"
LONGEST = 0.34  # arrow, over the diagonal of a picture
ROOM = 0.2  # for labels, over the same
NEAR = 0.3  # labels, over a picture's width, that stand beside each other
SHADE = 0.55  # of a face that looks away from the light
SHOWN = {"Front": "frontal, from the front", "Side": "sagittal, from the right"}
JOINT, BITE = "#a3104e", DARK

Triangles = tuple[np.ndarray, np.ndarray]  # corners (F, 3, 3) [m] in {S}, colours (F, 3)


@plot(where=lambda solution: of_muscles(solution.condyle.mechanism))
def forces(solution: xr.Dataset, time: float | None = None) -> Figure:
    """Forces on the jaw from the front and the side, and muscles coloured by activation.

    Args: time: of the sample drawn [s]; by default that of the largest load, or joint force.
    """
    mechanism = solution.condyle.mechanism
    if not of_muscles(mechanism):
        return nothing_to_draw("Forces on the platform", caption(solution), NO_MUSCLES)
    sample = _sample(solution, time)
    arrows = _arrows(solution, sample)
    drawn = _triangles(solution, sample)
    when = solution["time"].values[sample]
    column = narrow()
    size = (7.0, 7.6) if column else (9.2, 4.6)
    figure = new_figure(f"Forces on the jaw at {when:g} s", caption(solution), *size)
    figure.set_layout_engine("compressed")  # made for axes of fixed shape
    grid = figure.subplots(*((2, 1) if column else (1, 2)), squeeze=False).ravel()
    for axes, (view, title) in zip(grid, SHOWN.items(), strict=True):
        _draw(axes, view, drawn, arrows)
        axes.set_title(title)
    low, high = np.transpose([axes.get_ylim() for axes in grid])
    wide = max(np.ptp(axes.get_xlim()) for axes in grid) / 2
    for axes in grid:  # one scale
        middle = np.mean(axes.get_xlim())
        axes.set(xlim=(middle - wide, middle + wide), ylim=(low.min(), high.max()))
    top = activation_top(solution)
    stops = [activation_colour(value) for value in np.linspace(0.0, 1.0, 9)]
    ramp = LinearSegmentedColormap.from_list("activation", stops)
    bar = figure.colorbar(
        ScalarMappable(Normalize(0.0, top), ramp), ax=list(grid), shrink=0.5, aspect=25
    )
    bar.set_label("activation [1]")
    return figure


def _sample(solution: xr.Dataset, time: float | None) -> int:
    """The sample to draw: the nearest to a time, or where the load is largest."""
    times = solution["time"].values
    good = solution["status"].values == 0
    if not good.any():
        raise InputError("forces: this solution has no sample with a result")
    if time is not None:
        return int(np.argmin(np.where(good, np.abs(times - time), np.inf)))
    sizes = np.linalg.norm(solution["load"].values[:, :3], axis=1)
    if not np.nan_to_num(sizes).any():
        sizes = np.abs(solution["contact_force"].values).sum(axis=1)
    return int(np.argmax(np.where(good, np.nan_to_num(sizes), -1.0)))


def _triangles(solution: xr.Dataset, sample: int) -> Triangles:
    """Bone, teeth, surfaces and muscles of a sample."""
    mechanism = solution.condyle.mechanism
    one = {name: solution[name].values[sample : sample + 1] for name in ("pose", "joint")}
    scene = place(mechanism, one["pose"], one["joint"])
    parts, top = parts_of(mechanism, scene), activation_top(solution)
    at = scene.position[0] + parts.body.vertices @ scene.rotation[0].T
    teeth = len(parts.body.faces) if parts.body.teeth is None else parts.body.teeth
    role = "platform" if parts.body.teeth is None else "bone"
    pieces = [(at[parts.body.faces[:teeth]], ROLES[role][0])]
    pieces.append((at[parts.body.faces[teeth:]], ROLES["teeth"][0]))
    rows = {row.label: row for row in activation_rows(solution)}
    for band in parts.bands:
        points = scene.chains[band.chain].points
        line = np.array([np.atleast_2d(points[name])[0] for name in band.points])
        vertices, faces = band_mesh(line, scene.position[0], band.width)
        row = rows.get(band.chain)
        value = 0.0 if row is None else abs(row.values[sample]) * (row.scale or 1.0)
        tint = activation_colour(value if value > 1.0 else value / top)
        pieces.append((vertices[faces], tint))
    for patch in parts.surfaces.values():
        corners = patch.vertices[patch.faces]
        pieces += [(corners, ROLES["surface"][0]), (corners[:, ::-1], ROLES["surface"][0])]
    colours = [np.tile(to_rgb(tint), (len(corners), 1)) for corners, tint in pieces]
    return np.vstack([corners for corners, _ in pieces]), np.vstack(colours)


def _arrows(solution: xr.Dataset, sample: int) -> list[tuple[np.ndarray, np.ndarray, str, bool]]:
    """Place [m] and force [N] in {S}, (3,) each, a name, and whether the arrow ends there."""
    mechanism = solution.condyle.mechanism
    scene = place(mechanism, solution["pose"].values[[sample]], solution["joint"].values[[sample]])
    found = []
    for i, contact in enumerate(mechanism.contacts):
        at = scene.contacts[contact.name]
        if contact.surface.known:
            normal = contact_normals(contact, at)[0]
        else:
            normal = solution["contact_normal"].values[sample, i]
        force = solution["contact_force"].values[sample, i] * normal
        found.append((at[0], force, readable(contact.name), True))
    point = solution.condyle.options["load_point"] or ""
    at = scene.on_platform(mechanism.platform.points.get(point, (0.0, 0.0, 0.0)))[0]
    force = solution["load"].values[sample, :3]
    if np.nan_to_num(force).any():
        found.append((at, force, f"load{' at ' * bool(point)}{readable(point)}", False))
    return found


def _draw(axes: Axes, view: str, drawn: Triangles, arrows: list[Any]) -> None:
    """Faces that look at the camera, the furthest first, then the arrows; in millimetres."""
    away, up = (np.array(v) for v in VIEWS[view][:2])
    right = np.cross(up, away)
    corners, colours = drawn
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    with np.errstate(invalid="ignore", divide="ignore"):
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    seen = np.isfinite(corners).all(axis=(1, 2)) & (normal @ away > 0)
    corners, colours, normal = corners[seen], colours[seen], normal[seen]
    order = np.argsort((corners @ away).mean(axis=1))
    light = away + 0.7 * up + 0.3 * right
    lit = SHADE + (1 - SHADE) * np.clip(normal @ (light / np.linalg.norm(light)), 0.0, 1.0)
    flat = 1e3 * np.stack([corners @ right, corners @ up], axis=-1)
    tints = (colours * lit[:, None])[order]
    axes.add_collection(
        PolyCollection(list(flat[order]), facecolors=tints, edgecolors=tints, lw=0.3)
    )
    largest = max((float(np.linalg.norm(force)) for _, force, _, _ in arrows), default=0.0) or 1.0
    low, high = flat.reshape(-1, 2).min(axis=0), flat.reshape(-1, 2).max(axis=0)
    length = LONGEST * float(np.linalg.norm(high - low)) / largest
    ends, free_ends = [low, high], []
    for at, force, name, into in arrows:
        place_, way = (np.array([v @ right, v @ up]) for v in (1e3 * at, length * force))
        tail, head = (place_ - way, place_) if into else (place_, place_ + way)
        colour = JOINT if into else BITE
        axes.annotate(
            "", tuple(head), tuple(tail), zorder=4,
            arrowprops={
                "arrowstyle": "-|>", "color": colour, "lw": 2, "shrinkA": 0, "shrinkB": 0,
                "mutation_scale": 12,
            },
        )  # fmt: skip
        ends += [tail, head]
        text = f"{name}\n{np.linalg.norm(force):.3g} N"
        free_ends.append((tail if into else head, text, colour, (-way if into else way)[1] < 0))
    for i, (free, text, colour, below) in enumerate(free_ends):
        reach = NEAR * (high - low)[0]
        near = [j for j, one in enumerate(free_ends) if np.linalg.norm(free - one[0]) < reach]
        beside = "center" if len(near) == 1 else "right" if i == near[0] else "left"
        at = np.mean([free_ends[j][0] for j in near], axis=0)
        away_ = {"center": 0, "right": -2, "left": 2}[beside]
        axes.annotate(
            text, tuple(at), (away_, -3 if below else 3), textcoords="offset points", color=colour,
            ha=beside, va="top" if below else "bottom", zorder=5,
            fontsize=mpl.rcParams["legend.fontsize"],
            bbox={"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.8},
        )  # fmt: skip
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    room = ROOM * (high - low).max()
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
    axes.set_aspect("equal", adjustable="box")
    axes.grid(False)
    axis = "XYZ"[int(np.argmax(np.abs(right)))]
    axes.set(xlabel=f"{axis} [mm]", ylabel="Z [mm]")
