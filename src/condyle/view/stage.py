"""A mechanism as viser draws it. The scene is magnified to a few units, so that cameras fit."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from ..mechanism import Mechanism
from ..mechanism.coordinates import bryant_angles
from ..report.scene import (
    LIGHT,
    MARKERS,
    ROLES,
    VIEWS,
    Band,
    Bar,
    Scene,
    activation_colour,
    band_mesh,
    cloud,
    parts_of,
    place,
)
from ..report.scene.parts import JOINT, ROD
from .snapshot import Snapshot

RGB = tuple[int, int, int]

EXTENT = 3.0  # scene units across the mechanism
ARROW = EXTENT / 3  # of the largest load or contact force,
LEAST_WEIGHTS = {"load": 5.0, "contact": 0.5}  # or of this multiple of the weight, if larger
AMBIENT = 2.0


def rgb(colour: str) -> RGB:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


NEUTRAL, PLATFORM, SURFACE, BALL, BONE, TEETH = (
    rgb(ROLES[n][0]) for n in ("neutral", "platform", "surface", "ball", "bone", "teeth")
)
ALARM: RGB = (201, 42, 42)
WARNING: RGB = (224, 160, 74)
LOAD: RGB = (70, 80, 92)
HAND: RGB = (16, 93, 202)
MARKER = 2.4  # radius of a measured marker, over that of a slender rod
BODY = {"ok": PLATFORM, "warning": WARNING, "unreachable": ALARM}
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
        self._slender = self.scale * ROD * parts.size
        weight = mechanism.platform.mass * float(np.linalg.norm(mechanism.gravity))
        # Force of the longest arrow of each kind [N].
        self.largest_force: dict[str, float] = {
            kind: n * weight or 1.0 for kind, n in LEAST_WEIGHTS.items()
        }
        self._add_static()
        self._add_platform()
        self._add_chains(home)
        kinds = (("load", LOAD, 1), ("contact", BALL, len(mechanism.contacts)))
        self._arrows = {name: self._arrow(name, colour, n) for name, colour, n in kinds if n}
        self._paths: list[Any] = []
        self._markers: list[Any] = []
        self._pushes: list[Any] = []
        self.control = self._scene.add_transform_controls(
            "/drag", scale=0.55, line_width=3.0, depth_test=False
        )

    def _arrow(self, name: str, colour: RGB, count: int) -> Any:
        return self._scene.add_arrows(
            f"/forces/{name}",
            np.zeros((count, 2, 3)),
            colour,
            shaft_radius=0.018,
            head_radius=0.045,
            head_length=0.11,
            visible=False,
        )

    def _add_static(self) -> None:
        """Lights and contact surfaces."""
        self._scene.set_up_direction("+z")
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.add_light_ambient("/light", intensity=AMBIENT)
        for i, patch in enumerate(self._parts.surfaces.values()):
            vertices = self.scale * np.nan_to_num(patch.vertices)
            self._scene.add_mesh_simple(
                f"/surfaces/{i}", vertices, patch.faces, color=SURFACE, opacity=0.6, side="double"
            )
            if patch.bounded and len(patch.outline):
                border = self.scale * patch.outline
                self._scene.add_line_segments(f"/bounds/{i}", border, colors=(90, 90, 90), **SCREEN)

    def _add_platform(self) -> None:
        """The platform with its balls and landmarks; the ghost shows a pose that cannot be."""
        body = self._parts.body
        vertices, faces, jaw = self.scale * body.vertices, body.faces, body.teeth is not None
        add = self._scene
        self._platform = add.add_frame("/platform", show_axes=False)
        self._ghost = add.add_frame("/ghost", show_axes=False, visible=False)
        look: Any = {"flat_shading": True, "side": "double"}
        look |= {} if jaw else {"opacity": 0.6}
        self._sound = BODY | ({"ok": BONE} if jaw else {})
        bone, teeth = np.split(faces, [len(faces) if body.teeth is None else body.teeth])
        colour = self._sound["ok"]
        self._body = add.add_mesh_simple("/platform/body", vertices, bone, color=colour, **look)
        if jaw:
            add.add_mesh_simple("/platform/teeth", vertices, teeth, color=TEETH, **look)
        add.add_mesh_simple("/ghost/body", vertices, faces, color=ALARM, wireframe=True)
        self._balls = []
        for i, c in enumerate(self.mechanism.contacts):
            radius = self.scale * self._parts.balls[c.name]
            self._balls.append(self._named(f"ball{i}", c.name, c.point, radius, BALL))
        for i, (name, point) in enumerate(self.mechanism.platform.points.items()):
            self._named(f"landmark{i}", name, point, self._slender, LOAD)

    def _named(self, node: str, name: str, point: Any, radius: float, colour: RGB) -> Any:
        """A ball with a name, fixed to the platform."""
        at = self.scale * np.asarray(point)
        ball = self._scene.add_icosphere(f"/platform/{node}", radius, colour, position=at)
        self._scene.add_label(f"/platform/{node}/name", name)
        return ball

    def _add_chains(self, home: Scene) -> None:
        vertices, faces = unit_rod()
        self._bars: list[tuple[Bar, RGB, Any]] = []
        for i, bar in enumerate(self._parts.bars):
            colour = NEUTRAL if bar.colour is None else rgb(LIGHT[bar.colour])
            thin = vertices * [self.scale * bar.radius, self.scale * bar.radius, 1.0]
            node = self._scene.add_mesh_simple(f"/chains/{i}/{bar.body}", thin, faces, color=colour)
            self._bars.append((bar, colour, node))
        self._bands: list[tuple[Band, Any]] = []
        for i, band in enumerate(self._parts.bands):
            vertices, faces = self._band(home, band)
            node = self._scene.add_mesh_simple(f"/muscles/{i}", vertices, faces, flat_shading=True)
            self._bands.append((band, node))
        radius = self.scale * JOINT * self._parts.size
        self._joints = {
            key: self._scene.add_icosphere(f"/joints/{i}", radius, NEUTRAL)
            for i, key in enumerate(self._parts.joints)
        }

    def show(self, snapshot: Snapshot, dragging: bool = False) -> None:
        """Move everything to a snapshot; the drag control stays where it is held."""
        scene = snapshot.scene
        turn = quaternion(scene.rotation[0])
        position = self.scale * scene.position[0]
        self._platform.position, self._platform.wxyz = position, turn
        self._body.color = NEUTRAL if snapshot.stale else self._sound[snapshot.level]
        for ball in self._balls:
            ball.color = NEUTRAL if snapshot.stale else BALL
        if not dragging:
            self.control.position, self.control.wxyz = position, turn
        self._ghost.visible = snapshot.wanted is not None
        if snapshot.wanted is not None:
            wanted = place(
                self.mechanism, snapshot.wanted[None], np.zeros((1, len(self.mechanism.chains)))
            )
            self._ghost.position = self.scale * wanted.position[0]
            self._ghost.wxyz = quaternion(wanted.rotation[0])
        wrong = (*snapshot.out_of_reach, *snapshot.over)
        for bar, colour, node in self._bars:
            ill = bar.colour is not None and bar.chain in wrong
            node.color = NEUTRAL if snapshot.stale else ALARM if ill else colour
            self._lay(node, *(self._at(scene, bar.chain, name) for name in (bar.start, bar.end)))
        self._show_bands(snapshot, wrong)
        for (chain, name), node in self._joints.items():
            node.position = self._at(scene, chain, name)
        self._show_forces(snapshot)
        self._show_pushes(snapshot)
        places = np.full((len(self._markers), 3), np.nan)
        if snapshot.markers is not None:
            places = self.scale * snapshot.markers
        for handle, at in zip(self._markers, places, strict=True):
            handle.visible = bool(np.isfinite(at).all())
            if handle.visible:
                handle.position = at

    def _band(self, scene: Scene, band: Band) -> tuple[np.ndarray, np.ndarray]:
        """A muscle's vertices in scene units, and faces."""
        line = np.array([self._at(scene, band.chain, name) for name in band.points])
        inside, width = self.scale * scene.position[0], self.scale * band.width
        vertices, faces = band_mesh(line, inside, width)
        return vertices.astype(np.float32), faces

    def _show_bands(self, snapshot: Snapshot, wrong: tuple[str, ...]) -> None:
        """Muscles between their points, coloured by activation."""
        assert snapshot.activation is not None
        activation = dict(zip(self.mechanism.chain_names, snapshot.activation, strict=True))
        for band, node in self._bands:
            node.vertices = self._band(snapshot.scene, band)[0]
            tint = rgb(activation_colour(float(activation[band.chain])))
            ill = band.chain in wrong
            node.color = NEUTRAL if snapshot.stale else ALARM if ill else tint

    def _at(self, scene: Scene, chain: str, point: str) -> np.ndarray:
        """A point of a chain in scene units."""
        found: np.ndarray = self.scale * np.atleast_2d(scene.chains[chain].points[point])[0]
        return found

    def _lay(self, node: Any, start: np.ndarray, end: np.ndarray) -> None:
        """Put a rod of length 1 between two points."""
        length = float(np.linalg.norm(end - start))
        node.visible = bool(np.isfinite(length)) and length > 0
        if node.visible:
            node.position, node.wxyz = start, turn_onto((end - start) / length)
            node.scale = (1.0, 1.0, length)

    def _show_forces(self, snapshot: Snapshot) -> None:
        """A load leaves its point; a contact force points at the skin of the ball it pushes."""
        load_at = self.scale * snapshot.scene.on_platform(tuple(snapshot.load_at))
        forces = {"load": (snapshot.load[None], load_at)}
        if "contact" in self._arrows:
            balls = [snapshot.scene.contacts[c.name][0] for c in self.mechanism.contacts]
            forces["contact"] = snapshot.force_vector, self.scale * np.array(balls)
        radii = self.scale * np.array([[r] for r in self._parts.balls.values()])
        for name, (force, at) in forces.items():
            handle = self._arrows[name]
            handle.visible = bool(np.isfinite(force).all()) and bool(force.any())
            if not handle.visible:
                continue
            size = np.linalg.norm(force, axis=1, keepdims=True)
            arrow = force * ARROW / max(float(size.max()), self.largest_force[name])
            if name == "contact":
                at = at - arrow - radii * force / np.maximum(size, 1e-300)
            handle.points = np.stack([at, at + arrow], axis=1).astype(np.float32)

    def _show_pushes(self, snapshot: Snapshot) -> None:
        """Forces of loads that answer, and of the hand: each leaves its point."""
        if snapshot.pushes is None or snapshot.pushes_at is None:
            for handle in self._pushes:
                handle.visible = False
            return
        while len(self._pushes) < len(snapshot.pushes):
            last = len(self._pushes) == len(snapshot.pushes) - 1
            colour = HAND if last else LOAD
            self._pushes.append(self._arrow(f"pushes/{len(self._pushes)}", colour, 1))
        for handle, force, point in zip(
            self._pushes, snapshot.pushes, snapshot.pushes_at, strict=True
        ):
            size = float(np.linalg.norm(force))
            handle.visible = bool(np.isfinite(size)) and size > 0
            if handle.visible:
                at = self.scale * snapshot.scene.on_platform(tuple(point)).ravel()
                arrow = force * ARROW / max(size, self.largest_force["load"])
                handle.points = np.stack([at, at + arrow])[None].astype(np.float32)

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
        self._markers = [
            self._scene.add_icosphere(
                f"/markers/{i}", MARKER * self._slender, rgb(LIGHT[MARKERS[body][0]]), visible=False
            )
            for i, body in enumerate(bodies)
        ]

    def held_pose(self) -> np.ndarray:
        """X_EE, (6,) [m, rad], at which the drag control is held."""
        position = np.asarray(self.control.position) / self.scale
        return np.concatenate([position, bryant_angles(matrix(np.asarray(self.control.wxyz)))])

    def look_from(self, camera: Any, view: str) -> None:
        """Put a camera (a client's, or the first one of new clients) at one of `VIEWS`."""
        direction, up, _ = VIEWS[view]
        away = 0.8 * EXTENT * np.asarray(direction) / np.linalg.norm(direction)
        set_up = "up" if hasattr(camera, "up") else "up_direction"
        setattr(camera, set_up, up)
        camera.position = self.centre + away
        camera.look_at = self.centre

    def remove(self) -> None:
        """Clear the scene for another mechanism."""
        self._scene.reset()


def unit_rod(sides: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """A closed cylinder of radius 1 along Z from 0 to 1: vertices (V, 3), faces (F, 3)."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    vertices = np.vstack([ring, np.add(ring, [0, 0, 1]), [[0, 0, 0], [0, 0, 1]]])
    i, j = np.arange(sides), np.roll(np.arange(sides), -1)
    low, high = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    walls = [(i, j, j + sides), (i, j + sides, i + sides)]
    ends = [(low, j, i), (high, i + sides, j + sides)]
    return vertices, np.concatenate([np.column_stack(f) for f in walls + ends])


def turn_onto(direction: np.ndarray) -> np.ndarray:
    """Quaternion (w, x, y, z) that turns Z onto a unit vector."""
    x, y, z = direction
    if z < -1 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    q = np.array([1 + z, -y, x, 0.0])
    return q / np.linalg.norm(q)


def quaternion(R: np.ndarray) -> np.ndarray:
    """(w, x, y, z) of a rotation matrix (3, 3)."""
    return np.roll(Rotation.from_matrix(R).as_quat(), 1)


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    return Rotation.from_quat(np.roll(q, -1)).as_matrix()
