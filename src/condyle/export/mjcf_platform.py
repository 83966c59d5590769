"""The platform and what holds it: the contacts.

The first contacts carry the platform: their joints and a ball joint are its place in the tree, so
that MuJoCo cannot leave those surfaces. Two on parallel planes carry it together, on two slides, a
hinge along the normal and one along the line between them: all four freedoms, and no equation. Each
other contact is a runner, a small weightless body that stays on its surface, connected to the
platform. A one-sided contact on a plane is a real one, which may open: ball against plane, without
friction or with Coulomb's.
"""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from ..mechanism import Contact, Mechanism
from ..mechanism.surface import Plane
from .mjcf_tracks import Freedom, Track, track
from .mjcf_xml import child, element, onto, quaternion

RUNNER = 1e-3  # mass of a runner over the platform's
PARALLEL = 1e-12


class PlatformWriter:
    """Writes the platform, its contacts and landmarks into a document."""

    def __init__(self, root: Element, mechanism: Mechanism, look: Any, size: float) -> None:
        self.root, self.mechanism, self.look, self.size = root, mechanism, look, size
        self.world = child(root, "worldbody")
        self.notes: list[str] = []

    def write(self) -> None:
        contacts = self.mechanism.contacts
        real = [c for c in contacts if c.one_sided and isinstance(c.offset_surface, Plane)]
        held = [c for c in contacts if c not in real]
        tracks = {c.name: self._track(c) for c in held}
        seat = parallel_pair(held) or sorted(held, key=lambda c: _cost(tracks[c.name]))[:1]
        body = self._seated(seat, tracks)
        self._body(body)
        for contact in held:
            if contact not in seat:
                self._runner(contact, tracks[contact.name])
        for contact in contacts:
            if contact in real:
                self._real(body, contact)
            else:
                element(
                    body, "geom", class_="ball", pos=contact.point, size=[_ball(contact, self.size)]
                )
                self._wall(contact)
        self._remarks(held)

    def _seated(self, seat: list[Contact], tracks: dict[str, Track]) -> Element:
        """The platform's body, with the joints that its contacts leave it."""
        if not seat:
            body = element(self.world, "body", name="platform")
            element(body, "freejoint", name="platform")
            return body
        first = seat[0]
        if len(seat) == 1:
            body = self._stages(first, tracks[first.name], "platform")
            element(body, "joint", name=f"{first.name}_ball", type="ball", pos=first.point)
            return body
        n, d = _normal(first), np.subtract(seat[1].point, first.point)
        body = self._stages(first, tracks[first.name], "platform")
        for name, axis in (("yaw", n), ("roll", d / np.linalg.norm(d))):
            freedom = Freedom("hinge", axis, np.array(first.point))
            self._joint(body, f"{first.name}_{name}", freedom)
        return body

    def _stages(self, contact: Contact, found: Track, last: str) -> Element:
        """A body for every stage, the last one called `last`; those before it are weightless."""
        body = self.world
        for k, stage in enumerate(found.stages, 1):
            name = last if k == len(found.stages) else f"{contact.name}_carriage"
            body = element(body, "body", name=name)
            names = [f"{contact.name}_{k}{letter}" for letter in "abc"]
            for joint, freedom in zip(names, stage.freedoms, strict=False):
                self._joint(body, joint, freedom)
            if name != "platform":
                self._weightless(body, contact)
            if stage.law is not None:
                element(
                    child(self.root, "equality"),
                    "joint",
                    joint1=names[1],
                    joint2=names[0],
                    polycoef=stage.law,
                )
        return body

    def _joint(self, body: Element, name: str, freedom: Freedom) -> None:
        pos = freedom.point if freedom.kind == "hinge" else None
        element(body, "joint", name=name, type=freedom.kind, axis=freedom.axis, pos=pos)

    def _weightless(self, body: Element, contact: Contact) -> None:
        note = (
            "bodies that only guide a contact weigh nothing and have 0.1 % of the platform's mass"
        )
        if note not in self.notes:
            self.notes.append(note)
        body.set("gravcomp", "1")
        mass = RUNNER * self.mechanism.platform.mass
        moment = mass * (0.1 * self.size) ** 2
        element(body, "inertial", mass=mass, pos=contact.point, diaginertia=[moment] * 3)

    def _runner(self, contact: Contact, found: Track) -> None:
        name = f"{contact.name}_runner"
        self._stages(contact, found, name)
        element(
            child(self.root, "equality"),
            "connect",
            name=contact.name,
            body1=name,
            body2="platform",
            anchor=contact.point,
        )

    def _body(self, body: Element) -> None:
        platform = self.mechanism.platform
        i = platform.inertia
        tensor = [i.xx, i.yy, i.zz, i.xy, i.xz, i.yz]
        element(body, "inertial", mass=platform.mass, pos=np.zeros(3), fullinertia=tensor)
        mesh = element(child(self.root, "asset"), "mesh", name="platform", vertex=self.look.hull)
        element(body, "geom", class_="platform", type="mesh", mesh=mesh.get("name"))
        for chain in self.mechanism.chains:
            element(body, "site", name=f"{chain.name}_platform", pos=chain.platform)
        for contact in self.mechanism.contacts:
            element(body, "site", name=f"{contact.name}_contact", pos=contact.point)
        for name, point in platform.points.items():
            element(body, "site", name=name, pos=point)
        for kind in ("framepos", "framequat"):
            attributes = {"objtype": "xbody", "objname": "platform", "name": f"platform_{kind[5:]}"}
            element(child(self.root, "sensor"), kind, **attributes)

    def _real(self, body: Element, contact: Contact) -> None:
        """A ball against a plane: the normal of MuJoCo's plane is its Z axis, towards the ball."""
        ball, up = _ball(contact, self.size), contact.push * _normal(contact)
        wide = 0.3 * self.size
        element(
            body,
            "geom",
            class_="ball",
            name=f"{contact.name}_ball",
            pos=contact.point,
            size=[ball],
        )
        element(
            self.world,
            "geom",
            class_="wall",
            name=f"{contact.name}_wall",
            type="plane",
            pos=contact.point - ball * up,
            quat=quaternion(onto(up)),
            size=[wide, wide, 0.01],
        )
        mu = contact.friction.coefficient
        element(
            child(self.root, "contact"),
            "pair",
            name=contact.name,
            geom1=f"{contact.name}_ball",
            geom2=f"{contact.name}_wall",
            condim=3 if mu else 1,
            friction=[mu, mu, 0.005, 0.0001, 0.0001] if mu else None,
        )

    def _wall(self, contact: Contact) -> None:
        """The surface as it is drawn."""
        vertices, faces = self.look.patch(contact)
        if not len(faces):
            return
        used, renamed = np.unique(faces, return_inverse=True)
        element(
            child(self.root, "asset"),
            "mesh",
            name=f"{contact.name}_wall",
            inertia="shell",
            vertex=vertices[used],
            face=" ".join(map(str, renamed.ravel())),
        )
        element(self.world, "geom", class_="wall", type="mesh", mesh=f"{contact.name}_wall")

    def _track(self, contact: Contact) -> Track:
        found = track(contact, self.size)
        if found.error:
            where = (
                "within its bounds"
                if found.reach is None
                else (f"within {found.reach * 1e3:.3g} mm of home")
            )
            self.notes.append(
                f'contact "{contact.name}": a {contact.surface.kind} is followed by polynomials, '
                f"{found.error * 1e3:.2g} mm off at most {where}"
            )
        return found

    def _remarks(self, held: list[Contact]) -> None:
        for contact in held:
            if contact.friction.coefficient:
                self.notes.append(f'contact "{contact.name}": its friction is left out')
            if contact.one_sided:
                self.notes.append(
                    f'contact "{contact.name}": it cannot lift off here; only planes can be left'
                )


def parallel_pair(contacts: list[Contact]) -> list[Contact]:
    """Two contacts on parallel planes, if there are such, whose line is not along the normal."""
    flat = [c for c in contacts if isinstance(c.offset_surface, Plane)]
    for i, first in enumerate(flat):
        for second in flat[i + 1 :]:
            n, d = _normal(first), np.subtract(second.point, first.point)
            parallel = np.linalg.norm(np.cross(n, _normal(second))) < PARALLEL
            if parallel and np.linalg.norm(np.cross(n, d)) > 0.1 * np.linalg.norm(d):
                return [first, second]
    return []


def _normal(contact: Contact) -> np.ndarray:
    """Of a plane, upwards, (3,)."""
    a, b = contact.surface.slope  # type: ignore[union-attr]
    return np.array([-a, -b, 1.0]) / np.linalg.norm([a, b, 1.0])


def _cost(found: Track) -> tuple[int, int, float]:
    """What follows exactly and on one body carries best."""
    laws = sum(stage.law is not None for stage in found.stages)
    return laws, len(found.stages), found.error


def _ball(contact: Contact, size: float) -> float:
    return contact.ball_radius or 0.06 * size
