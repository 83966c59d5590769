"""What a film shows beside the solids: floor, skull, frames, scale of forces, colours, the time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D

from ..mechanism import Mechanism
from ..mechanism.vocabulary import words_of
from .naming import readable, stem
from .scene import LIGHT, Camera, Scene, activation_colour, styles, tint_of
from .scene.arrows import TINTS
from .scene.floor import Floor, round_below
from .scene.skull import Skull

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LETTERS: dict[str, Any] = {"color": tint_of("ink"), "fontsize": 13}
AXES = ("#c92a2a", "#2b8a3e", "#1864ab")  # X, Y and Z of a frame
TRIAD = 0.5  # length of a frame's axes over the size of the picture's parts
SCALE = 0.13  # longest arrow of the scale over the width of the film
KINDS = {"load": "load", "contact": "contact force"}
MOST_COLOURS = 8  # in the legend


class FilmFrame:
    """Floor and frames in space, and texts in the corners; `show` moves them to a sample."""

    def __init__(self, axes: Axes, camera: Camera, scene: Scene, size: float) -> None:
        self._camera, self._scene, self._size = camera, scene, size
        look: dict[str, Any] = {"transform": axes.transAxes, "va": "top", **LETTERS}
        self._clock = axes.text(0.02, 0.965, "", **look)
        self._triad = LineCollection([], colors=AXES, lw=2.4, zorder=3)
        axes.add_collection(self._triad)
        self._name = axes.text(0, 0, "{M}", zorder=3, **LETTERS)
        home = camera.flat(triad(np.zeros(3), np.eye(3), size))
        axes.add_collection(LineCollection(list(home), colors=AXES, lw=1.2, ls=":", zorder=3))
        x, y = home[0, 0]
        axes.text(x, y, "{S} ", zorder=3, ha="right", va="top", **LETTERS)

    def show(self, sample: int, text: str) -> None:
        place, turn = self._scene.position[sample], self._scene.rotation[sample]
        flat = self._camera.flat(triad(place, turn, self._size))
        self._triad.set_segments(list(flat))
        self._name.set_position(flat[2, 1])
        self._clock.set_text(text)


def triad(origin: np.ndarray, turn: np.ndarray, size: float) -> np.ndarray:
    """Origin and tips of the axes of frames, (..., 3, 2, 3) [m].

    Args: origin: (..., 3) [m];  turn: to {S}, (..., 3, 3);  size: of the picture's parts [m].
    """
    start = np.broadcast_to(origin[..., None, :], turn.shape)
    return np.stack([start, start + TRIAD * size * np.swapaxes(turn, -1, -2)], axis=-2)


def draw_floor(axes: Axes, camera: Camera, floor: Floor) -> None:
    """The grid, and how long its step is."""
    lines = list(camera.flat(floor.lines))
    axes.add_collection(LineCollection(lines, colors="#d5dae0", lw=0.9, zorder=0))
    text = f"grid {1e3 * floor.step:g} mm"
    axes.text(0.98, 0.03, text, transform=axes.transAxes, ha="right", **LETTERS)


def draw_skull(axes: Axes, camera: Camera, skull: Skull) -> None:
    """The side of a skull that looks at the camera, behind everything; the row of upper teeth."""
    corners = skull.vertices[skull.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = list(camera.flat(corners[normal @ camera.away > 0]))
    bone = tint_of("bone")
    for look in ({"facecolors": bone, "alpha": 0.35, "lw": 0}, {"fc": "none", "edgecolors": bone}):
        axes.add_collection(PolyCollection(seen, zorder=0.5, **look))
    row = LineCollection([camera.flat(skull.teeth)], colors=tint_of("ink"), lw=1.5, ls="--")
    row.set_zorder(2)
    axes.add_collection(row)
    text = "shell: muscles' origins and joints; dashes: upper teeth"
    axes.text(0.98, 0.085, text, transform=axes.transAxes, ha="right", **LETTERS)


def draw_scale(axes: Axes, largest: Mapping[str, float], scales: Mapping[str, float]) -> None:
    """An arrow of a round force for each kind of force, below on the left.

    Args: largest: of each kind [N];  scales: metres a newton.
    """
    low, high = axes.get_xlim()
    place = axes.get_xaxis_transform()
    kinds = [kind for kind in KINDS if largest.get(kind, 0.0) > 0.0]
    for row, kind in enumerate(kinds):
        most = SCALE * (high - low) / scales[kind]
        force = round_below(min(largest[kind], most))
        start, y = low + 0.02 * (high - low), 0.045 + 0.055 * row
        tip = start + scales[kind] * force
        shape = {"arrowstyle": "-|>", "color": tint_of(TINTS[kind]), "lw": 3, "mutation_scale": 16}
        shape |= {"shrinkA": 0, "shrinkB": 0}
        ends: dict[str, Any] = {"xy": (tip, y), "xytext": (start, y), "arrowprops": shape}
        axes.annotate("", xycoords=place, textcoords=place, **ends)
        text = f"{force:g} N {KINDS[kind]}"
        axes.text(tip + 0.01 * (high - low), y, text, transform=place, va="center", **LETTERS)


def draw_colours(axes: Axes, mechanism: Mechanism, top: float, muscles: bool) -> None:
    """What the colours of chains, or of muscles from rest to `top`, mean."""
    rows = list(_activations(top) if muscles else _chains(mechanism))
    handles = [Line2D([], [], color=colour, lw=6, label=text) for colour, text in rows]
    if len(handles) <= MOST_COLOURS:
        heading = words_of(mechanism)("activation") if muscles else None
        place: dict[str, Any] = {"loc": "upper right", "bbox_to_anchor": (0.99, 0.985)}
        legend = axes.legend(handles=handles, title=heading, frameon=False, fontsize=12, **place)
        for text in (*legend.get_texts(), legend.get_title()):
            text.set_color(LETTERS["color"])
            text.set_fontsize(12)


def _chains(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    """Colours with the names that chains of one colour have in common."""
    names = mechanism.chain_names
    owners: dict[int, list[str]] = {}
    for name, style in zip(names, styles(names), strict=True):
        owners.setdefault(style.colour, []).append(name)
    for colour, own in owners.items():
        stems = list(dict.fromkeys(map(stem, own)))
        yield LIGHT[colour], ", ".join(readable(one).strip() or own[0] for one in stems)


def _activations(top: float) -> Iterator[tuple[str, str]]:
    for part in (0.0, 0.5, 1.0):
        yield activation_colour(part), f"{part * top:g}"
