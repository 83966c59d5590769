"""A map beside the mechanism, to turn and to click: the mechanism goes where it is clicked.

Three coordinates make a cube, two an upright square in it. A ball in it follows the pose.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import viser

from ..analysis.map.axes import Axis, Grid
from ..analysis.map.isosurface import first_hit, isosurface, sheet
from ..analysis.map.map_files import grid_and_reach
from ..kinematics.constraints import indices
from ..mechanism import COORDINATES
from ..model.model import Model

if TYPE_CHECKING:
    import xarray as xr

FINE = 41  # points along each axis of a cube
SIDE = 1.6  # of the cube, in scene units
BESIDE = (-0.4, 2.8, 0.3)  # of the mechanism's centre
SKIN, EDGES, BALL = (86, 180, 233), (120, 120, 120), (194, 24, 91)
SHADES = 12
RAMP = ((68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37))  # viridis
INWARD = np.array([0.0, 1e-3, 3e-3, 1e-2, 2e-2, 4e-2, 8e-2])  # of the cube, along a hand's ray


class MapLayer:
    """A map in the scene of one mechanism."""

    grid: Grid
    vertices: np.ndarray
    faces: np.ndarray

    def __init__(
        self, scene: viser.SceneApi, centre: np.ndarray, model: Model, dataset: xr.Dataset
    ) -> None:
        """Args: dataset: a map over two or three coordinates."""
        self.grid, self._reach = grid_and_reach(dataset, model)
        # Directions of the cube that the axes are along.
        self._along = [0, 2] if len(self.grid.axes) == 2 else [0, 1, 2]
        self._corner = centre + np.array(BESIDE) - SIDE / 2
        self.vertices, self.faces, shades = self._shape(dataset)
        self.handles: list[Any] = self._frame(scene)
        self.surfaces = [
            scene.add_mesh_simple(
                f"/map/surface{i}",
                (self._corner + SIDE * self.vertices).astype(np.float32),
                self.faces[shades == i].astype(np.uint32),
                color=SKIN if len(self.grid.axes) == 3 else colour(i),
                opacity=0.75 if len(self.grid.axes) == 3 else None,
                flat_shading=True,
                side="double",
            )
            for i in np.unique(shades)
        ]
        self._ball = scene.add_icosphere("/map/here", 0.04, BALL, visible=False)
        self.handles += [*self.surfaces, self._ball]

    def _shape(self, dataset: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Vertices, faces, and the shade of each face."""
        if len(self.grid.axes) == 3:
            axes = tuple(Axis(a.name, a.low, a.high, FINE) for a in self.grid.axes)
            fine = Grid(self.grid.names, axes, self.grid.held)
            margin = self._reach.margin(fine.block(0, fine.size)).reshape(fine.shape)
            vertices, faces = isosurface(margin)
            return vertices, faces, np.zeros(len(faces), dtype=int)
        vertices, faces = sheet(dataset["cause"].values == 0)
        return vertices, faces, shades_of(dataset)[faces[:, 0]]

    def _frame(self, scene: viser.SceneApi) -> list[Any]:
        """Edges of the range, and what it is a range of."""
        d = len(self.grid.axes)
        corners = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)], float)
        pairs = [(i, i | 1 << k) for i in range(8) for k in range(3) if not i & 1 << k]
        if d == 2:
            corners[:, 1] = 0.5
            pairs = [(i, j) for i, j in pairs if not (i | j) & 2]
        lines = self._corner + SIDE * np.array([[corners[i], corners[j]] for i, j in pairs])
        handles: list[Any] = [
            scene.add_line_segments(
                "/map/range", lines.astype(np.float32), colors=EDGES,
                thickness=1.5, thickness_units="screen",
            )
        ]  # fmt: skip
        for k, axis in enumerate(self.grid.axes):
            at = np.full(3, -0.06)
            at[1] = 0.5 if d == 2 else -0.06
            at[self._along[k]] = 0.5
            place = self._corner + SIDE * at
            handles.append(scene.add_label(f"/map/axis{k}", axis_text(axis), position=place))
        return handles

    def on_click(self, take: Callable[[np.ndarray], None]) -> None:
        """Call `take` with q, (m,), where a hand clicks on the surface."""

        # On viser's own thread, as the panel does.
        async def clicked(event: Any) -> None:
            found = self.state_at(np.array(event.ray_origin), np.array(event.ray_direction))
            if found is not None:
                take(found)

        for surface in self.surfaces:
            surface.on_click(clicked)

    def state_at(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray | None:
        """q, (m,), where a ray of the scene meets the surface, or a little further inside."""
        start, way = (origin - self._corner) / SIDE, direction / np.linalg.norm(direction)
        hit = first_hit(start, way, self.vertices, self.faces)
        if hit is None:
            return None
        d = len(self.grid.axes)
        points = np.clip(hit + INWARD[:, None] * way, 0.0, 1.0)[:, self._along]
        low = np.array([axis.low for axis in self.grid.axes])
        span = np.array([axis.span for axis in self.grid.axes])
        q = self.grid.states(low + span * (points if d == 3 else points[:1]))
        with np.errstate(invalid="ignore"):
            inside = np.flatnonzero(self._reach.margin(q) >= 0)
        return np.array(q[inside[0] if inside.size else 0])

    def show(self, pose: np.ndarray) -> None:
        """Put the ball at a pose, X_EE (6,), if the range has it."""
        q = pose[indices(self.grid.names)][self.grid.columns]
        place = np.full(3, 0.5)
        place[self._along] = [(v - a.low) / a.span for v, a in zip(q, self.grid.axes, strict=True)]
        self._ball.visible = bool(np.isfinite(place).all()) and 0 <= place.min() <= place.max() <= 1
        if self._ball.visible:
            self._ball.position = self._corner + SIDE * place


def shades_of(dataset: xr.Dataset) -> np.ndarray:
    """Shades of a map over two coordinates, (n1 n2,), 0 to SHADES - 1 by its first quantity."""
    names = [n for n in dataset.data_vars if n not in ("status", "cause", "kind")]
    shown = [n for n in names if dataset[n].ndim == 2]
    if not shown:
        return np.zeros(dataset["cause"].size, dtype=int)
    values = dataset[shown[0]].values.ravel()
    good = values[np.isfinite(values)]
    low, high = (good.min(), good.max()) if good.size else (0.0, 1.0)
    part = np.nan_to_num((values - low) / (high - low or 1.0))
    return np.clip(part * SHADES, 0, SHADES - 1).astype(int)


def colour(shade: int) -> tuple[int, int, int]:
    """The colour of a shade, from dark to bright."""
    at = shade / (SHADES - 1) * (len(RAMP) - 1)
    red, green, blue = (np.interp(at, range(len(RAMP)), [c[i] for c in RAMP]) for i in range(3))
    return int(red), int(green), int(blue)


def axis_text(axis: Axis) -> str:
    """'X: -5 to 5 mm'."""
    scale, unit = (1e3, "mm") if axis.name in COORDINATES[:3] else (180 / np.pi, "°")
    return f"{axis.name}: {axis.low * scale:.3g} to {axis.high * scale:.3g} {unit}"
