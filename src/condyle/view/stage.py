"""A mechanism as viser draws it. The scene is magnified to a few units, so that cameras fit."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from ..kinematics.bryant import bryant_angles
from ..mechanism import Contact, Mechanism
from ..report.scene import LIGHT, Rod, contact_patch, place, platform_hull, styles
from .shapes import matrix, quaternion, turn_onto, unit_rod
from .snapshot import Snapshot

RGB = tuple[int, int, int]

EXTENT = 3.0  # scene units across the mechanism
ARROW = EXTENT / 3  # of the largest load or contact force,
LEAST_WEIGHTS = {"load": 5.0, "contact": 0.5}  # unless less than so many weights of the platform
AMBIENT = 2.0
NEUTRAL: RGB = (125, 136, 148)
PLATFORM: RGB = (176, 190, 205)
SURFACE: RGB = (229, 181, 103)
BALL: RGB = (194, 24, 91)
ALARM: RGB = (201, 42, 42)
WARNING: RGB = (224, 160, 74)
LOAD: RGB = (70, 80, 92)
HAND: RGB = (16, 93, 202)
MARKERS: dict[str, RGB] = {"fixed": (7, 169, 115), "platform": (16, 93, 202), "": (116, 95, 138)}
MARKER = 2.4  # radius of a measured marker, over that of a rod
BODY = {"calm": PLATFORM, "warning": WARNING, "unreachable": ALARM}
VIEWS = {
    "Front": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "Side": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "Top": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "Oblique": ((0.7, -0.7, 0.4), (0.0, 0.0, 1.0)),
}


def rgb(colour: str) -> RGB:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


class Stage:
    """The scene's nodes of one mechanism, moved by `show`."""

    def __init__(self, server: viser.ViserServer, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._scene = server.scene
        home = place(mechanism, np.zeros((1, 6)), np.zeros((1, len(mechanism.chains))))
        self._hull = platform_hull(mechanism)
        points = [p.reshape(-1, 3) for d in home.chains.values() for p in d.points.values()]
        cloud = np.vstack([*points, self._hull[0]])
        low, high = cloud.min(axis=0), cloud.max(axis=0)
        self.scale = EXTENT / float(np.linalg.norm(high - low))
        self.centre = self.scale * (low + high) / 2
        self._radius = 0.017
        weight = mechanism.platform.mass * float(np.linalg.norm(mechanism.gravity))
        # Force of the longest arrow of each kind [N].
        self.largest_force = {kind: n * weight or 1.0 for kind, n in LEAST_WEIGHTS.items()}
        self._rods: dict[tuple[str, str], Any] = {}
        self._drawings = home.chains
        self._add_static(home)
        self._add_platform()
        self._add_chains()
        self._arrows = {
            name: self._arrow(name, colour, count) for name, colour, count in self._arrow_kinds()
        }
        self._paths: list[Any] = []
        self._markers: list[Any] = []
        self._pushes: list[Any] = []
        self.control = self._scene.add_transform_controls(
            "/drag", scale=0.55, line_width=3.0, depth_test=False
        )

    def _arrow_kinds(self) -> list[tuple[str, RGB, int]]:
        count = len(self.mechanism.contacts)
        return [("load", LOAD, 1)] + ([("contact", BALL, count)] if count else [])

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

    def _add_static(self, home: Any) -> None:
        """Lights and contact surfaces."""
        self._scene.set_up_direction("+z")
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.add_light_ambient("/light", intensity=AMBIENT)
        for i, contact in enumerate(self.mechanism.contacts):
            patch = contact_patch(contact, home.contacts[contact.name], 1.0 / self.scale)
            self._scene.add_mesh_simple(
                f"/surfaces/{i}",
                self.scale * np.nan_to_num(patch.vertices),
                patch.faces,
                color=SURFACE,
                opacity=0.6,
                side="double",
            )
            if patch.bounded and len(patch.outline):
                self._scene.add_line_segments(
                    f"/bounds/{i}",
                    self.scale * patch.outline,
                    colors=(90, 90, 90),
                    thickness=2.0,
                    thickness_units="screen",
                )

    def _add_platform(self) -> None:
        """The platform with its balls and landmarks; the ghost shows a pose that cannot be."""
        vertices, faces = self._hull
        self._platform = self._scene.add_frame("/platform", show_axes=False)
        self._ghost = self._scene.add_frame("/ghost", show_axes=False, visible=False)
        self._body = self._scene.add_mesh_simple(
            "/platform/body",
            self.scale * vertices,
            faces,
            color=PLATFORM,
            opacity=0.6,
            flat_shading=True,
            side="double",
        )
        self._scene.add_mesh_simple(
            "/ghost/body", self.scale * vertices, faces, color=ALARM, wireframe=True
        )
        self._balls: list[Any] = []
        for i, contact in enumerate(self.mechanism.contacts):
            radius = self._ball_radius(contact)
            at = self.scale * np.asarray(contact.point)
            ball = self._scene.add_icosphere(f"/platform/ball{i}", radius, BALL, position=at)
            self._balls.append(ball)
            self._scene.add_label(f"/platform/ball{i}/name", contact.name)
        for i, (name, point) in enumerate(self.mechanism.platform.points.items()):
            at = self.scale * np.asarray(point)
            self._scene.add_icosphere(f"/platform/landmark{i}", self._radius, LOAD, position=at)
            self._scene.add_label(f"/platform/landmark{i}/name", name)

    def _ball_radius(self, contact: Contact) -> float:
        """In scene units: its own, where the file gives one."""
        return self.scale * contact.ball_radius if contact.ball_radius else 3.5 * self._radius

    def _add_chains(self) -> None:
        vertices, faces = unit_rod()
        self._colours: dict[tuple[str, str], RGB] = {}
        self._joints: dict[tuple[str, str], Any] = {}
        looks = styles(self.mechanism.chain_names)
        for i, (chain, look) in enumerate(zip(self.mechanism.chains, looks, strict=True)):
            drawing = self._drawings[chain.name]
            for rod in drawing.rods:
                colour = rgb(LIGHT[look.colour]) if rod.moving else NEUTRAL
                radius = self._radius * rod.thickness
                thin = vertices * [radius, radius, 1.0]
                name = f"/chains/{i}/{rod.body}"
                key = (chain.name, rod.body)
                self._rods[key] = self._scene.add_mesh_simple(name, thin, faces, color=colour)
                self._colours[key] = colour
            for point in drawing.balls:
                self._joints[chain.name, point] = self._scene.add_icosphere(
                    f"/chains/{i}/joint_{point}", 1.9 * self._radius, NEUTRAL
                )

    def show(self, snapshot: Snapshot, dragging: bool = False) -> None:
        """Move everything to a snapshot; the drag control stays where it is held."""
        scene = snapshot.scene
        turn = quaternion(scene.rotation[0])
        position = self.scale * scene.position[0]
        self._platform.position, self._platform.wxyz = position, turn
        self._body.color = NEUTRAL if snapshot.stale else BODY[snapshot.level]
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
        for chain in self.mechanism.chains:
            drawing = scene.chains[chain.name]
            points = {n: self.scale * np.atleast_2d(p)[0] for n, p in drawing.points.items()}
            for rod in drawing.rods:
                tint = self._colours[chain.name, rod.body]
                if snapshot.stale:
                    tint = NEUTRAL
                elif rod.moving and chain.name in (*snapshot.broken, *snapshot.over):
                    tint = ALARM
                self._lay(chain.name, rod, points, tint)
            for name in drawing.balls:
                self._joints[chain.name, name].position = points[name]
        self._show_forces(snapshot)
        self._show_pushes(snapshot)
        places = np.full((len(self._markers), 3), np.nan)
        if snapshot.markers is not None:
            places = self.scale * snapshot.markers
        for handle, at in zip(self._markers, places, strict=True):
            handle.visible = bool(np.isfinite(at).all())
            if handle.visible:
                handle.position = at

    def _lay(self, chain: str, rod: Rod, points: dict[str, np.ndarray], tint: RGB) -> None:
        handle = self._rods[chain, rod.body]
        start, along = points[rod.start], points[rod.end] - points[rod.start]
        length = float(np.linalg.norm(along))
        handle.visible = bool(np.isfinite(length)) and length > 0
        if handle.visible:
            handle.position, handle.wxyz = start, turn_onto(along / length)
            handle.scale = (1.0, 1.0, length)
        handle.color = tint

    def _show_forces(self, snapshot: Snapshot) -> None:
        """A load leaves its point; a contact force points at the skin of the ball it pushes."""
        load_at = self.scale * snapshot.scene.on_platform(tuple(snapshot.load_at))
        forces = {"load": (snapshot.load[None], load_at)}
        if "contact" in self._arrows:
            balls = [snapshot.scene.contacts[c.name][0] for c in self.mechanism.contacts]
            forces["contact"] = snapshot.force_vector, self.scale * np.array(balls)
        radii = np.array([[self._ball_radius(c)] for c in self.mechanism.contacts])
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
                thickness=2.0,
                thickness_units="screen",
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
                f"/markers/{i}", MARKER * self._radius, MARKERS[body], visible=False
            )
            for i, body in enumerate(bodies)
        ]

    def held_pose(self) -> np.ndarray:
        """X_EE, (6,) [m, rad], at which the drag control is held."""
        position = np.asarray(self.control.position) / self.scale
        return np.concatenate([position, bryant_angles(matrix(np.asarray(self.control.wxyz)))])

    def look_from(self, camera: Any, view: str) -> None:
        """Put a camera (a client's, or the first one of new clients) at one of `VIEWS`."""
        direction, up = VIEWS[view]
        away = 0.8 * EXTENT * np.asarray(direction) / np.linalg.norm(direction)
        set_up = "up" if hasattr(camera, "up") else "up_direction"
        setattr(camera, set_up, up)
        camera.position = self.centre + away
        camera.look_at = self.centre

    def remove(self) -> None:
        """Clear the scene for another mechanism."""
        self._scene.reset()
