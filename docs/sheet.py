"""What drawings are made on: a sheet that looks along a direction, in light and dark ink."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

GROUNDS = {"light": "#1b2026", "dark": "#e6eaee"}  # the colour of ink on each
TINTS = {  # light, dark
    "chain": ("#105dca", "#6aa9f4"),
    "joint": ("#d97a03", "#f0a04a"),
    "surface": ("#b07a1e", "#d8ac62"),
    "force": ("#c2185b", "#ff7fab"),
    "soft": ("#66727f", "#a3aebb"),
    "body": ("#c9d3de", "#46525f"),
}
ROOM = 0.27, 0.1  # for words, across and up
FRAMES = "{S}, at home {M}"
FROM = (0.6, -1.0, 0.45)
SIZE = (3.9, 3.2)  # inch: read on a phone without turning it


class Sheet:
    """Axes in millimetres that look along a direction, and what is drawn on them."""

    def __init__(self, ground: str, away: Any = (1.0, -1.3, 0.55), size: Any = SIZE) -> None:
        from matplotlib.figure import Figure

        self.figure, self.room = Figure(figsize=size), ROOM
        self.axes = self.figure.add_axes((0.01, 0.01, 0.98, 0.98))
        self.axes.set_aspect("equal", adjustable="datalim")
        self.axes.axis("off")
        self.ink = GROUNDS[ground]
        self._dark = ground == "dark"
        self.away = away = np.asarray(away) / np.linalg.norm(away)
        self._right = np.cross((0.0, 0.0, 1.0), away)
        self._right /= np.linalg.norm(self._right)
        self._up = np.cross(away, self._right)

    def tint(self, name: str) -> str:
        return TINTS[name][self._dark] if name in TINTS else self.ink

    def flat(self, points: Any) -> np.ndarray:
        """Places on the sheet, (..., 2) [mm], of points (..., 3) [m]."""
        points = 1e3 * np.asarray(points, dtype=float)
        return np.stack([points @ self._right, points @ self._up], axis=-1)

    def line(self, points: Any, tint: str = "ink", width: float = 2.0, **more: Any) -> None:
        x, y = self.flat(points).T
        more = {"solid_capstyle": "round"} | more
        self.axes.plot(x, y, color=self.tint(tint), lw=width, **more)

    def dot(self, point: Any, tint: str = "joint", size: float = 8.0) -> None:
        x, y = self.flat(point)
        face = {"mec": self.ink, "mew": 0.8, "zorder": 5}
        self.axes.plot([x], [y], "o", color=self.tint(tint), ms=size, **face)

    def area(self, points: Any, tint: str, alpha: float = 0.4) -> None:
        self.axes.fill(*self.flat(points).T, color=self.tint(tint), alpha=alpha, lw=0)

    def mesh(self, corners: np.ndarray, tint: str, alpha: float | None = None) -> None:
        """Triangles (F, 3, 3), those that face the light stronger; alpha: all are as dense."""
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import to_rgb

        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lit = np.abs(normal @ (0.3, -0.5, 0.8)) / np.linalg.norm(normal, axis=1)
        flat, look = list(self.flat(corners)), {"facecolors": self.tint(tint), "zorder": 1}
        if alpha is not None:
            shade = np.outer(0.6 + 0.4 * lit, to_rgb(self.tint(tint)))
            look |= {"facecolors": shade, "edgecolors": shade, "lw": 0.3}
        dense = 0.2 + 0.35 * lit if alpha is None else None
        self.axes.add_collection(PolyCollection(flat, alpha=dense, **look))

    def ball(self, centre: Any, radius: float, behind: bool) -> None:
        """A ball, before or behind meshes; it looks the same from everywhere."""
        from matplotlib.patches import Circle

        look = {"facecolor": self.tint("body"), "edgecolor": self.ink, "lw": 1.1}
        look["zorder"] = 0.5 if behind else 3
        self.axes.add_patch(Circle(tuple(self.flat(centre)), 1e3 * radius, **look))
        self.dot(centre, "joint", 4)

    def arrow(self, start: Any, end: Any, tint: str = "ink", **more: Any) -> None:
        look = {
            "arrowstyle": "-|>",
            "color": self.tint(tint),
            "lw": 1.8,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        ends = [tuple(self.flat(p)) for p in (end, start)]
        self.axes.annotate("", *ends, arrowprops=look | {"mutation_scale": 13} | more, zorder=6)
        self.axes.plot(*np.transpose(ends), alpha=0)  # the limits take it in

    def word(self, point: Any, text: str, by: Any = (6, 4), tint: str = "ink", **more: Any) -> None:
        """A text beside a point; by: how far [pt]."""
        ha = "left" if by[0] > 0 else "right" if by[0] < 0 else "center"
        look = {"textcoords": "offset points", "color": self.tint(tint), "fontsize": 9.5}
        look |= {"ha": ha, "va": "center", "zorder": 7}
        self.axes.annotate(text, tuple(self.flat(point)), by, **look | more)

    def frame(self, origin: Any, arm: float, name: str, by: Any = (-6, -8)) -> None:
        """Axes X, Y, Z of a frame."""
        for axis, letter in zip(np.eye(3), "XYZ", strict=True):
            end = np.asarray(origin) + arm * axis
            self.arrow(origin, end, "soft", lw=1.2, mutation_scale=9)
            self.word(np.asarray(origin) + 1.22 * arm * axis, letter, (0, 0), "soft", fontsize=8)
        self.word(origin, name, by, "soft")

    def save(self, path: Path) -> None:
        self.axes.margins(*self.room)
        self.figure.savefig(path, transparent=True, metadata={"Date": None})


def chain_sheet(
    ground: str, name: str, number: int, away: Any, rods: bool = True
) -> tuple[Sheet, Any, Any]:
    """A sheet with a chain of a bundled machine at home and its platform; chain, and its points."""
    import condyle
    from condyle.report.scene import place, platform_hull

    mechanism = condyle.load_mechanism(name)
    chain = mechanism.chains[number]
    home = place(mechanism, np.zeros((1, 6)), np.zeros((1, len(mechanism.chains))))
    drawing = home.chains[chain.name]
    at = {key: np.atleast_2d(point)[0] for key, point in drawing.points.items()}
    sheet = Sheet(ground, away)
    from scipy.spatial import ConvexHull

    body = platform_hull(mechanism)[0]
    sheet.area(body[ConvexHull(sheet.flat(body)).vertices], "body", 0.55)
    for rod in drawing.rods if rods else ():
        tint = "chain" if rod.moving else "soft"
        sheet.line([at[rod.start], at[rod.end]], tint, 2.5 + 1.5 * rod.thickness)
    for ball in drawing.balls if rods else ():
        sheet.dot(at[ball])
    span = float(np.ptp(np.vstack([*at.values(), body]), axis=0).max())
    return sheet, chain, at | {"span": span}
