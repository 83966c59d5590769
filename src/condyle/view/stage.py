"""The scene as viser draws it, magnified to a few units, so that cameras fit."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from ..mechanism import Mechanism
from ..mechanism.coordinates import bryant_angles
from ..report.naming import side
from ..report.scene import (
    LIGHT,
    MARKERS,
    VIEWS,
    Force,
    Scene,
    Solid,
    activation_colour,
    cloud,
    parts_of,
    place,
    rgb,
    tint_of,
)
from ..report.scene.arrows import SHAFT
from ..report.scene.parts import ROD
from ..report.scene.solids import HEAD, HEAD_WIDE, across
from .snapshot import Snapshot

RGB = tuple[int, int, int]

EXTENT = 3.0  # scene units across the mechanism
ARROW = EXTENT / 3  # of the largest load or contact force,
LEAST_WEIGHTS = {"load": 5.0, "contact": 0.5}  # or of this multiple of the weight, if larger
AMBIENT = 2.0

NEUTRAL, BALL, LOAD = (rgb(tint_of(role)) for role in ("neutral", "ball", "ink"))
ALARM: RGB = (201, 42, 42)
WARNING: RGB = (224, 160, 74)
HAND: RGB = (16, 93, 202)
FORCES = {"contact": BALL, "load": LOAD, "push": LOAD, "hand": HAND}
# A left and a right point may be at one place of the picture, and their names on both sides of it.
ANCHORS: Any = {"l": "bottom-left", "r": "bottom-right"}
LETTERS = 0.8  # of viser's size
MARKER = 2.4  # radius of a measured marker, over that of a slender rod
SCREEN: Any = {"thickness": 2.0, "thickness_units": "screen"}


class Stage:
    """The scene's nodes of one mechanism, moved by `show`."""

    def __init__(self, server: viser.ViserServer, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._scene = server.scene
        home = place(mechanism, np.zeros((1, 6)), np.zeros((1, len(mechanism.chains))))
        self._parts = parts = parts_of(mechanism, home)
        points = cloud(home, parts.body.vertices)
        low, high = points.min(axis=0), points.max(axis=0)
        self.scale: float = EXTENT / float(np.linalg.norm(high - low))
        self.centre: np.ndarray = self.scale * (low + high) / 2
        weight = mechanism.platform.mass * float(np.linalg.norm(mechanism.gravity))
        # Force of the longest arrow of each kind [N].
        self.largest_force: dict[str, float] = {
            kind: n * weight or 1.0 for kind, n in LEAST_WEIGHTS.items()
        }
        self._add_static()
        self._platform = self._scene.add_frame("/platform", show_axes=False)
        self._ghost = self._scene.add_frame("/ghost", show_axes=False, visible=False)
        ghost = self.scale * parts.body.vertices, parts.body.faces
        self._scene.add_mesh_simple("/ghost/body", *ghost, color=ALARM, wireframe=True)
        self.nodes: list[tuple[Solid, Any]] = [
            (solid, self._add_solid(i, solid, home)) for i, solid in enumerate(parts.solids)
        ]
        self._arrows: dict[str, Any] = {}
        self._paths: list[Any] = []
        self._markers: list[Any] = []
        self.control = self._scene.add_transform_controls(
            "/drag", scale=0.55, line_width=3.0, depth_test=False
        )

    def _add_static(self) -> None:
        """Lights, and borders of the contact surfaces."""
        self._scene.set_up_direction("+z")
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.add_light_ambient("/light", intensity=AMBIENT)
        patches = self._parts.surfaces.values()
        lines = [patch.outline for patch in patches if patch.bounded]
        for i, line in enumerate([*lines, *(patch.hatch for patch in patches)]):
            if len(line):
                ends = self.scale * line
                self._scene.add_line_segments(f"/bounds/{i}", ends, colors=(90, 90, 90), **SCREEN)

    def _add_solid(self, number: int, solid: Solid, home: Scene) -> Any:
        """A mesh for a solid, and a name beside those that have one on the platform."""
        on = "/platform" * (solid.motion == "platform")
        name = f"{on}/{solid.group}/{number}"
        vertices = solid.vertices
        if self._is_rigid(solid):
            vertices = vertices * ([1.0, 1.0, 1.0 / self.scale] if solid.motion == "line" else 1.0)
        else:
            vertices = solid.at(home)
        node = self._scene.add_mesh_simple(
            name,
            (self.scale * vertices).astype(np.float32),
            solid.faces.astype(np.uint32),
            color=rgb(tint_of(solid.colour)),
            opacity=None if solid.opacity == 1.0 else solid.opacity,
            flat_shading=solid.group == "platform" or solid.colour == "activation",
            side="double" if solid.group in ("platform", "surfaces") else "front",
        )
        if on and solid.group in ("balls", "landmarks"):
            points = self.mechanism.platform.points
            points = points | {contact.name: contact.point for contact in self.mechanism.contacts}
            at = self.scale * np.asarray(points[solid.owner])
            self._scene.add_label(
                f"{name}/name",
                solid.owner,
                position=at,
                font_screen_scale=LETTERS,
                anchor=ANCHORS.get(side(solid.owner)[:1].lower(), "top-center"),
            )
        return node

    @staticmethod
    def _is_rigid(solid: Solid) -> bool:
        """Whether a node's place and length say all: a muscle turns, and may bend, on its line."""
        return solid.colour != "activation"

    def show(self, snapshot: Snapshot, dragging: bool = False) -> None:
        """Move everything to a snapshot; the drag control stays where it is held."""
        scene = snapshot.scene
        turn = quaternion(scene.rotation[0])
        position = self.scale * scene.position[0]
        self._platform.position, self._platform.wxyz = position, turn
        if not dragging:
            self.control.position, self.control.wxyz = position, turn
        self._ghost.visible = snapshot.wanted is not None
        if snapshot.wanted is not None:
            wanted = place(
                self.mechanism, snapshot.wanted[None], np.zeros((1, len(self.mechanism.chains)))
            )
            self._ghost.position = self.scale * wanted.position[0]
            self._ghost.wxyz = quaternion(wanted.rotation[0])
        for solid, node in self.nodes:
            if solid.group not in ("landmarks", "surfaces"):
                node.color = self._colour(solid, snapshot)
            if solid.motion in ("line", "point"):
                self._move(solid, node, scene)
        self._show_forces(snapshot)
        places = np.full((len(self._markers), 3), np.nan)
        if snapshot.markers is not None:
            places = self.scale * snapshot.markers
        for handle, at in zip(self._markers, places, strict=True):
            handle.visible = bool(np.isfinite(at).all())
            if handle.visible:
                handle.position = at

    def _colour(self, solid: Solid, snapshot: Snapshot) -> RGB:
        """Grey without a result; red where a chain is at fault, the platform by how bad it is."""
        if snapshot.stale:
            return NEUTRAL
        if solid.group == "platform" and solid.colour != "teeth":
            bad = {"warning": WARNING, "unreachable": ALARM}.get(snapshot.level)
            return bad or rgb(tint_of(solid.colour))
        if solid.colour == "activation":
            number = self.mechanism.chain_names.index(solid.owner)
            assert snapshot.activation is not None
            tint = activation_colour(float(snapshot.activation[number]))
        else:
            tint = tint_of(solid.colour)
        wrong = (*snapshot.out_of_reach, *snapshot.over)
        fault = solid.colour not in ("neutral", "ball") and solid.owner in wrong
        return ALARM if fault else rgb(tint)

    def _move(self, solid: Solid, node: Any, scene: Scene) -> None:
        """Put a solid between, or at, the points of its chain."""
        line = self.scale * scene.line(solid.owner, solid.points, 0)
        if not self._is_rigid(solid):
            node.vertices = (self.scale * solid.at(scene)).astype(np.float32)
            return
        length = float(np.linalg.norm(line[-1] - line[0]))
        node.visible = bool(np.isfinite(line).all()) and (length > 0 or len(line) == 1)
        if node.visible:
            node.position = line[0]
        if node.visible and solid.motion == "line":
            wide, thin = across(line, self.scale * scene.position[0])
            along = (line[1] - line[0]) / length
            node.wxyz = quaternion(np.column_stack([wide, thin, along]))
            node.scale = (1.0, 1.0, length)

    def _show_forces(self, snapshot: Snapshot) -> None:
        """Arrows of each kind of force, as long as the largest of the kind allows."""
        kinds: dict[str, list[Force]] = {}
        for force in snapshot.forces(self._parts):
            kinds.setdefault(force.kind, []).append(force)
        for kind in self._arrows.keys() | kinds.keys():
            forces = kinds.get(kind, [])
            most = max((force.largest for force in forces), default=0.0)
            least = self.largest_force["contact" if kind == "contact" else "load"]
            ends = [
                np.concatenate(force.ends(snapshot.scene, ARROW / self.scale / max(most, least)))
                for force in forces
            ]
            points = self.scale * np.reshape(ends, (-1, 2, 3)).astype(np.float32)
            visible = most > 0 and bool(np.isfinite(points).all())
            if visible and kind not in self._arrows:
                radius = SHAFT * self.scale * self._parts.size
                self._arrows[kind] = self._scene.add_arrows(
                    f"/forces/{kind}",
                    points,
                    FORCES[kind],
                    shaft_radius=radius,
                    head_radius=HEAD_WIDE * radius,
                    head_length=HEAD * radius,
                )
            if kind in self._arrows:
                self._arrows[kind].visible = visible
            if visible:
                self._arrows[kind].points = points

    def add_grip(self) -> Any:
        """A handle at a point, to pull it by."""
        return self._scene.add_transform_controls(
            "/grip", scale=0.4, line_width=3.0, depth_test=False, disable_rotations=True
        )

    def show_paths(self, paths: list[np.ndarray]) -> None:
        """Draw the paths (N, 3) [m] of a solution, in place of those before."""
        for handle in self._paths:
            handle.remove()
        self._paths = [
            self._scene.add_line_segments(
                f"/paths/{i}",
                self.scale * np.stack([path[:-1], path[1:]], axis=1),
                colors=BALL,
                **SCREEN,
            )
            for i, path in enumerate(paths)
            if len(path) > 1
        ]

    def show_markers(self, bodies: list[str]) -> None:
        """Make measured markers of these bodies, in place of those before; `show` moves them."""
        for handle in self._markers:
            handle.remove()
        radius = MARKER * self.scale * ROD * self._parts.size
        self._markers = [
            self._scene.add_icosphere(
                f"/markers/{i}", radius, rgb(LIGHT[MARKERS[body][0]]), visible=False
            )
            for i, body in enumerate(bodies)
        ]

    def held_pose(self) -> np.ndarray:
        """X_EE, (6,) [m, rad], at which the drag control is held."""
        position = np.asarray(self.control.position) / self.scale
        return np.concatenate([position, bryant_angles(matrix(np.asarray(self.control.wxyz)))])

    def look_from(self, camera: Any, view: str | None = None) -> None:
        """Put a camera (a client's, or the first one of new clients) at one of `VIEWS`."""
        direction, up = VIEWS[view or self._parts.view]
        away = 0.8 * EXTENT * np.asarray(direction) / np.linalg.norm(direction)
        set_up = "up" if hasattr(camera, "up") else "up_direction"
        setattr(camera, set_up, up)
        camera.position = self.centre + away
        camera.look_at = self.centre

    def remove(self) -> None:
        """Clear the scene for another mechanism."""
        self._scene.reset()


def quaternion(R: np.ndarray) -> np.ndarray:
    """(w, x, y, z) of a rotation matrix (3, 3)."""
    return np.roll(Rotation.from_matrix(R).as_quat(), 1)


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    return Rotation.from_quat(np.roll(q, -1)).as_matrix()
