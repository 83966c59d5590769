"""The platform and what holds it: the contacts.

The first contacts carry the platform: their joints and a ball joint are its place in the tree, so
that MuJoCo cannot leave those surfaces. Two on parallel planes carry it together, on two slides, a
hinge along the normal and one along the line between them: all four freedoms, and no equation. Each
other contact is a runner, a small weightless body that stays on its surface, connected to the
platform. A one-sided contact on a plane is a real one, which may open: ball against plane, without
friction or with Coulomb's.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np

from ..mechanism import Contact
from ..mechanism.surface import Plane
from .mjcf_tracks import Freedom, Track, track
from .mjcf_xml import Document, element, inertial, quaternion

RUNNER = 1e-3  # mass of a runner over the platform's
PARALLEL = 1e-12


def write_platform(d: Document) -> None:
    """The platform, its contacts and landmarks."""
    contacts = d.mechanism.contacts
    real = [c for c in contacts if c.one_sided and isinstance(c.offset_surface, Plane)]
    held = [c for c in contacts if c not in real]
    tracks = {c.name: _track(d, c) for c in held}
    seat = parallel_pair(held) or sorted(held, key=lambda c: _cost(tracks[c.name]))[:1]
    body = _seated(d, seat, tracks)
    _platform(d, body)
    for contact in held:
        if contact not in seat:
            runner = f"{contact.name}_runner"
            _stages(d, contact, tracks[contact.name], runner)
            ends = {"body1": runner, "body2": "platform", "anchor": contact.point}
            d.add("equality", "connect", name=contact.name, **ends)
    for contact in contacts:
        if contact in real:
            _real(d, body, contact)
        else:
            size = [_ball(d, contact)]
            element(body, "geom", class_="ball", pos=contact.point, size=size)
            _wall(d, contact)
    for contact in held:
        if contact.friction.coefficient:
            d.note(f'contact "{contact.name}": its friction is left out')
        if contact.one_sided:
            d.note(f'contact "{contact.name}": it cannot lift off here; only planes can be left')


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


def _seated(d: Document, seat: list[Contact], tracks: dict[str, Track]) -> Element:
    """The platform's body, with the joints that its contacts leave it."""
    if not seat:
        body = element(d.world, "body", name="platform")
        element(body, "freejoint", name="platform")
        return body
    first = seat[0]
    body = _stages(d, first, tracks[first.name], "platform")
    if len(seat) == 1:
        element(body, "joint", name=f"{first.name}_ball", type="ball", pos=first.point)
        return body
    line = np.subtract(seat[1].point, first.point)
    for name, axis in (("yaw", _normal(first)), ("roll", line / np.linalg.norm(line))):
        _joint(body, f"{first.name}_{name}", Freedom("hinge", axis, np.array(first.point)))
    return body


def _stages(d: Document, contact: Contact, found: Track, last: str) -> Element:
    """A body for every stage, the last one called `last`; all but the platform are weightless."""
    body = d.world
    for k, stage in enumerate(found.stages, 1):
        name = last if k == len(found.stages) else f"{contact.name}_carriage"
        body = element(body, "body", name=name)
        names = [f"{contact.name}_{k}{letter}" for letter in "abc"]
        for joint, freedom in zip(names, stage.freedoms, strict=False):
            _joint(body, joint, freedom)
        if name != "platform":
            d.note(
                "bodies that only guide a contact weigh nothing and have 0.1 % of the platform's "
                "mass"
            )
            body.set("gravcomp", "1")
            mass = RUNNER * d.mechanism.platform.mass
            inertial(body, mass, contact.point, [mass * (0.1 * d.size) ** 2] * 3)
        if stage.law is not None:
            joints = {"joint1": names[1], "joint2": names[0]}
            d.add("equality", "joint", **joints, polycoef=stage.law)
    return body


def _joint(body: Element, name: str, freedom: Freedom) -> None:
    pos = freedom.point if freedom.kind == "hinge" else None
    element(body, "joint", name=name, type=freedom.kind, axis=freedom.axis, pos=pos)


def _platform(d: Document, body: Element) -> None:
    """Mass, hull, sites and sensors."""
    platform = d.mechanism.platform
    i = platform.inertia
    tensor = [i.xx, i.yy, i.zz, i.xy, i.xz, i.yz]
    element(body, "inertial", mass=platform.mass, pos=np.zeros(3), fullinertia=tensor)
    d.add("asset", "mesh", name="platform", vertex=d.look.hull)
    element(body, "geom", class_="platform", type="mesh", mesh="platform")
    sites = {f"{chain.name}_platform": chain.platform for chain in d.mechanism.chains}
    # Names may meet here, which is said where the document is written.
    pairs = [*sites.items(), *((f"{c.name}_contact", c.point) for c in d.mechanism.contacts)]
    for name, point in [*pairs, *platform.points.items()]:
        element(body, "site", name=name, pos=point)
    for kind in ("pos", "quat"):
        of = {"objtype": "xbody", "objname": "platform"}
        d.add("sensor", f"frame{kind}", **of, name=f"platform_{kind}")


def _real(d: Document, body: Element, contact: Contact) -> None:
    """A ball against a plane: the normal of MuJoCo's plane is its Z axis, towards the ball."""
    ball, up = _ball(d, contact), contact.push * _normal(contact)
    name = {"class_": "ball", "name": f"{contact.name}_ball"}
    element(body, "geom", **name, pos=contact.point, size=[ball])
    wall = {"class_": "wall", "name": f"{contact.name}_wall", "type": "plane"}
    place = {"pos": contact.point - ball * up, "quat": quaternion(_onto(up))}
    element(d.world, "geom", **wall, **place, size=[0.3 * d.size, 0.3 * d.size, 0.01])
    mu, geoms = contact.friction.coefficient, {"geom1": name["name"], "geom2": wall["name"]}
    friction = [mu, mu, 0.005, 0.0001, 0.0001] if mu else None
    rough = {"condim": 3 if mu else 1, "friction": friction}
    d.add("contact", "pair", name=contact.name, **geoms, **rough)


def _wall(d: Document, contact: Contact) -> None:
    """The surface as it is drawn."""
    vertices, faces = d.look.patch(contact)
    if not len(faces):
        return
    used, renamed = np.unique(faces, return_inverse=True)
    mesh = {"vertex": vertices[used], "face": " ".join(map(str, renamed.ravel()))}
    d.add("asset", "mesh", name=f"{contact.name}_wall", inertia="shell", **mesh)
    element(d.world, "geom", class_="wall", type="mesh", mesh=f"{contact.name}_wall")


def _track(d: Document, contact: Contact) -> Track:
    found = track(contact, d.size)
    if found.error:
        reach = found.reach
        where = "its bounds" if reach is None else f"{reach * 1e3:.3g} mm of home"
        d.note(
            f'contact "{contact.name}": a {contact.surface.kind} is followed by polynomials, '
            f"{found.error * 1e3:.2g} mm off at most within {where}"
        )
    return found


def _normal(contact: Contact) -> np.ndarray:
    """Of a plane, upwards, (3,)."""
    a, b = contact.surface.slope  # type: ignore[union-attr]
    return np.array([-a, -b, 1.0]) / np.linalg.norm([a, b, 1.0])


def _onto(direction: np.ndarray) -> np.ndarray:
    """A rotation whose Z axis is a unit vector, (3, 3)."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(direction)))], direction)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(direction, x), direction])


def _cost(found: Track) -> tuple[int, int, float]:
    """What follows exactly and on one body carries best."""
    laws = sum(stage.law is not None for stage in found.stages)
    return laws, len(found.stages), found.error


def _ball(d: Document, contact: Contact) -> float:
    return contact.ball_radius or 0.06 * d.size
