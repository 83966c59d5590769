"""A mechanism for MuJoCo: one file of MJCF, its home the mechanism's and its controls our efforts.

Loops are closed by `connect`, contacts by what carries the platform. Joints and
actuators have the names of their chains, so that `data.actuator("masseter_left").ctrl` is an effort
in N m or N, and joint coordinates are zero at home.

The first contacts carry the platform: their joints and a ball joint are its place in the tree, so
that MuJoCo cannot leave those surfaces. Two on parallel planes carry it together, on two slides, a
hinge along the normal and one along the line between them: all four freedoms, and no equation. A
ball joint carries it alone. Each other contact is a runner, a small weightless body that stays on
its surface, connected to the platform. A unilateral contact on a plane is one of MuJoCo: ball
against plane, frictionless or with Coulomb friction.

Chains are trees of bodies: `connect` closes each loop at its platform joint. A rod turns on two
hinges along Y and Z of N_i0, as in `kinematics.chain`; behind a crank these turn with the crank,
which changes nothing but how the rod spins about its own line. A cable is a tendon.
"""

from __future__ import annotations

import math
import os
from typing import Any
from xml.etree.ElementTree import Element

import casadi as ca
import numpy as np

from ..errors import CondyleError
from ..files.atomic import write_text
from ..kinematics.chain import FAMILIES
from ..kinematics.chain.chain_drawing import CABLE
from ..mechanism import Contact, Mechanism, as_mechanism
from ..mechanism.ball_joint import BallJoint, of_joints
from ..mechanism.chain import limits
from ..mechanism.ligament import Ligament
from ..mechanism.surface.freedom import Freedom
from ..model.model import Model
from .mjcf_tracks import BodyTrack, track
from .mjcf_xml import Document, element, inertial, quaternion, rgba
from .written import Written, file_at

RUNNER = 1e-3  # mass of a runner over the platform's
PARALLEL = 1e-12
LIGHT = 1e-6  # mass of a massless body over the platform's
THIN, SLENDER = 1e-2, 0.03  # radius of gyration; drawn radius; over the mechanism's length
ROUNDING = 1e-12  # of a moment over the greatest
UNLIMITED = 1e9  # N: of a cable that has no greatest tension
ZERO = np.zeros(3)


def export_mjcf(
    model: Model | Mechanism | str | os.PathLike[str], path: str | os.PathLike[str]
) -> Written:
    """Write a model for MuJoCo (MJCF): loops, contacts, actuators with limits and losses, sensors.

    Controls are efforts [N m or N], joints are zero at home.

    Args:   model: a model, a mechanism, its file, or the name of a bundled one.
            path: a folder for NAME.xml, or a file that ends in .xml.
    Returns: the file. Its `notes` say what of the mechanism is approximate or left out.
    Raises: UnsupportedError: where a surface cannot be followed, or two names agree.
            InputError: if the file cannot be written.
    """
    mechanism = as_mechanism(model)
    made = mjcf(mechanism)
    file = file_at(path, mechanism.name, ".xml")
    write_text(file, made.text)
    return Written([file], made.notes, {"mechanism": mechanism.name, "notes": made.notes})


def mjcf(mechanism: Mechanism) -> Document:
    """A mechanism as MJCF.

    Raises: UnsupportedError: where a surface cannot be followed, or names would meet.
    """
    document = Document(mechanism)
    write_platform(document)
    for chain in mechanism.chains:
        write_chain(document, chain)
    for ligament in mechanism.ligaments:
        write_ligament(document, ligament)
    if mechanism.enabled_walls:
        document.note("walls are left out")
    _home(document)
    document.finish()
    return document


def _home(document: Document) -> None:
    """A keyframe with the efforts that hold the mechanism at home, if there are such."""
    try:
        model = Model(document.mechanism, backend="numpy")
        rest = np.zeros(document.mechanism.degrees_of_freedom)
        efforts = model.inverse_dynamics(rest, rest, rest)
        if efforts.status:
            raise CondyleError
        document.add("keyframe", "key", name="home", ctrl=efforts.effort)
    except CondyleError:
        document.note("no efforts hold it at home, so the file has no keyframe")


def write_platform(d: Document) -> None:
    """The platform, its contacts and landmarks."""
    contacts = d.mechanism.contacts
    real = [c for c in contacts if c.one_sided and c.offset_surface.flat]
    sockets = of_joints(contacts)
    held = [c for c in contacts if c not in real and c.name not in sockets]
    tracks = {c.name: _track(d, c) for c in held}
    if sockets:
        seat, body = [], _in_socket(d, next(iter(sockets.values())))
    else:
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
            if contact.name not in sockets:
                _wall(d, contact)
    for contact in held:
        if contact.friction.coefficient:
            d.note(f'contact "{contact.name}": its friction is left out')
        if contact.one_sided:
            d.note(f'contact "{contact.name}": contact loss is left out, but on planes')


def parallel_pair(contacts: list[Contact]) -> list[Contact]:
    """Two contacts on parallel planes, if there are such, whose line is not along the normal."""
    flat = [c for c in contacts if c.offset_surface.flat]
    for i, first in enumerate(flat):
        for second in flat[i + 1 :]:
            n, d = _normal(first), np.subtract(second.point, first.point)
            parallel = np.linalg.norm(np.cross(n, _normal(second))) < PARALLEL
            if parallel and np.linalg.norm(np.cross(n, d)) > 0.1 * np.linalg.norm(d):
                return [first, second]
    return []


def _in_socket(d: Document, joint: BallJoint) -> Element:
    """The platform's body on a ball joint, which MuJoCo cannot leave."""
    body = element(d.world, "body", name="platform")
    element(body, "joint", name=joint.name, type="ball", pos=joint.point)
    return body


def _seated(d: Document, seat: list[Contact], tracks: dict[str, BodyTrack]) -> Element:
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


def _stages(d: Document, contact: Contact, guide: BodyTrack, last: str) -> Element:
    """A body for every stage, the last one called `last`; all but the platform are weightless."""
    body = d.world
    for k, stage in enumerate(guide.stages, 1):
        name = last if k == len(guide.stages) else f"{contact.name}_carriage"
        body = element(body, "body", name=name)
        names = [f"{contact.name}_{k}{letter}" for letter in "abc"]
        for joint, freedom in zip(names, stage.freedoms, strict=False):
            _joint(body, joint, freedom)
        if name != "platform":
            d.note(
                "bodies that only guide a contact have 0.1 % of the platform's mass and no weight"
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
    element(body, "inertial", mass=platform.mass, pos=platform.com, fullinertia=tensor)
    d.add("asset", "mesh", name="platform", vertex=d.look.hull)
    element(body, "geom", class_="platform", type="mesh", mesh="platform")
    sites = {f"{chain.name}_platform": chain.platform for chain in d.mechanism.chains}
    # Two names may agree here, which is reported where the document is written.
    pairs = [*sites.items(), *((f"{c.name}_contact", c.point) for c in d.mechanism.contacts)]
    pairs += [(f"{one.name}_insertion", one.platform) for one in d.mechanism.ligaments]
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


def _track(d: Document, contact: Contact) -> BodyTrack:
    guide = track(contact, d.size)
    if guide.error:
        reach = guide.reach
        where = "its bounds" if reach is None else f"{reach * 1e3:.3g} mm of home"
        d.note(
            f'contact "{contact.name}": a {contact.surface.kind} is followed by polynomials, '
            f"{guide.error * 1e3:.2g} mm off at most within {where}"
        )
    return guide


def _normal(contact: Contact) -> np.ndarray:
    """The normal of a plane, upwards, (3,)."""
    _, gradient = contact.gradient()
    return gradient / np.linalg.norm(gradient)


def _onto(direction: np.ndarray) -> np.ndarray:
    """A rotation whose Z axis is a unit vector, (3, 3)."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(direction)))], direction)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(direction, x), direction])


def _cost(found: BodyTrack) -> tuple[int, int, float]:
    """What follows exactly and on one body carries best."""
    laws = sum(stage.law is not None for stage in found.stages)
    return laws, len(found.stages), found.error


def _ball(d: Document, contact: Contact) -> float:
    return contact.ball_radius or 0.06 * d.size


def write_chain(d: Document, chain: Any) -> None:
    """Bodies, joints, actuator and sensors of a chain: a tendon, if the family has no bodies."""
    family = FAMILIES[chain.kind]
    tendon = not family.bodies
    (_tendon if tendon else _bodies)(d, chain)
    if family.idealised:
        d.note(family.idealised)
    low, high, speed = limits(chain)
    if tendon:  # its force would lengthen it
        low, high = max(low, 0.0), min(high, UNLIMITED)
    kind, name = "tendon" if tendon else "joint", chain.name
    limited = math.isfinite(low) or math.isfinite(high)
    ends = np.clip([low, high], -UNLIMITED, UNLIMITED) if limited else None
    gear = [-1.0] if tendon else None
    d.add("actuator", "motor", name=name, **{kind: name}, gear=gear, ctrlrange=ends)
    for quantity in ("pos", "vel"):
        d.add("sensor", f"{kind}{quantity}", name=f"{name}_{quantity}", **{kind: name})
    if math.isfinite(speed):
        d.add("custom", "numeric", name=f"speed_limit_{name}", data=[speed])
    if chain.actuator.coulomb:
        d.note(
            "Coulomb friction of actuators is MuJoCo's frictionloss, which holds at rest; "
            "condyle's fades below the smoothing speed"
        )


def _tendon(d: Document, chain: Any) -> None:
    look = {"width": CABLE * SLENDER * d.size, "rgba": rgba(d.look.colours[chain.name])}
    tendon = d.add("tendon", "spatial", name=chain.name, **look, **_losses(chain))
    start, *via = chain.fixed_points
    element(d.world, "site", name=f"{chain.name}_base", pos=start)
    element(tendon, "site", site=f"{chain.name}_base")
    for i, point in enumerate(via, 1):
        element(d.world, "site", name=f"{chain.name}_via_{i}", pos=point)
        element(tendon, "site", site=f"{chain.name}_via_{i}")
    element(tendon, "site", site=f"{chain.name}_platform")


def _bodies(d: Document, chain: Any) -> None:
    """The links at home, each on the one before by its joint; `connect` closes the loop at M."""
    family, home = FAMILIES[chain.kind], ca.SX.zeros(3)
    c = family.named(ca.SX(family.vector(family.constants(chain))))
    bodies: dict[str, tuple[Element, np.ndarray]] = {}
    parent, at = d.world, ZERO
    for link, joint in zip(family.links(c, home), family.joints(c, home), strict=True):
        part = link.name.removesuffix("s")
        name = f"{chain.name}_{part}"
        point, spin, centre = (_number(x) for x in (joint.point, link.spin, link.centre))
        body = element(parent, "body", name=name, pos=point[:, 0] - at)
        if joint.driven:
            kind, axis = ("hinge", joint.turns) if joint.turns.numel() else ("slide", joint.slides)
            own = {"type": kind, "axis": _number(axis), **_losses(chain)}
            element(body, "joint", name=chain.name, **own)
        else:
            for which, axis in zip(("beta", "gamma"), spin[:, 1:].T, strict=True):
                element(body, "joint", name=f"{name}_{which}", type="hinge", axis=axis)
        com = (centre - point)[:, 0]
        stays = parent is d.world and not joint.slides.numel() and not com.any()
        inertia, turning = _number(link.inertia), np.linalg.matrix_rank(spin)
        _massive(d, body, float(link.mass), com, inertia, int(turning), stays)
        parent, at = bodies[part] = body, point[:, 0]
    M = np.array(chain.platform, dtype=float)
    ends = {"body1": name, "body2": "platform", "anchor": M - at}
    d.add("equality", "connect", name=f"{chain.name}_loop", **ends)
    _drawn(d, chain, M, bodies, part)


def _number(expression: ca.SX) -> np.ndarray:
    return np.array(ca.evalf(expression))


def _drawn(
    d: Document, chain: Any, M: np.ndarray, bodies: dict[str, tuple[Element, np.ndarray]], last: str
) -> None:
    """The family's drawing at home, what is none of its bodies on the last."""
    drawing = FAMILIES[chain.kind].drawing(chain, np.zeros(1), M[None])
    points = {name: np.reshape(point, (-1, 3))[0] for name, point in drawing.points.items()}
    ends: dict[str, tuple[Element, np.ndarray]] = {}
    for rod in drawing.rods:
        line, size = [points[rod.start], points[rod.end]], [rod.thickness * SLENDER * d.size]
        if not rod.moving:
            element(d.world, "geom", class_="fixed", type="cylinder", fromto=line, size=size)
            continue
        body, at = ends[rod.start] = ends[rod.end] = bodies.get(rod.body, bodies[last])
        look = {"fromto": line - at, "size": size, "rgba": rgba(d.look.colours[chain.name])}
        element(body, "geom", class_="drawn", type="capsule", **look)
    for name in drawing.balls:
        body, at = ends[name]
        size = [1.5 * SLENDER * d.size]
        element(body, "geom", class_="drawn", pos=points[name] - at, size=size)


def write_ligament(d: Document, ligament: Ligament) -> None:
    """A tendon with a spring that is slack up to its length."""
    stiffness = ligament.stiffness
    if isinstance(stiffness, tuple):
        strain, force = stiffness[-1]
        stiffness = force / (strain * ligament.slack_length)
        d.note("ligaments with a table have one stiffness, that of the table's last row")
    if ligament.damping:
        d.note("MuJoCo damps ligaments where they are slack too")
    name, look = ligament.name, {"width": 0.4 * SLENDER * d.size}
    law = {"springlength": [0.0, ligament.slack_length], "stiffness": stiffness}
    damping = ligament.damping or None
    tendon = d.add("tendon", "spatial", name=name, **look, **law, damping=damping)
    element(d.world, "site", name=f"{name}_origin", pos=ligament.base)
    for end in ("origin", "insertion"):
        element(tendon, "site", site=f"{name}_{end}")


def _losses(chain: Any) -> dict[str, float | None]:
    a = chain.actuator
    losses = {"armature": a.reflected_inertia, "damping": a.viscous, "frictionloss": a.coulomb}
    return {key: value or None for key, value in losses.items()}


def _massive(
    d: Document,
    body: Element,
    mass: float,
    com: np.ndarray,
    inertia: np.ndarray,
    turning: int,
    stays: bool,
) -> None:
    """Mass and moments of a body, such as MuJoCo accepts.

    It has no massless bodies: those get a millionth of the platform, and no weight. Of a body that
    turns about one axis only the moment about that matters, and of one that slides none.

    Args: turning: number of axes that it turns about;  stays: whether its mass centre is at rest.
    """
    if not mass:
        mass = LIGHT * d.mechanism.platform.mass
        body.set("gravcomp", "1")
        if not stays:
            d.note("massless bodies have a millionth of the platform's mass and no weight")
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    if turning < 2:
        moments[:] = moments[-1]
    least = mass * (THIN * d.size) ** 2
    zero = moments <= ROUNDING * moments[-1]
    if zero.any():
        moments[zero] = min(least, moments[~zero].min(initial=least))
        if turning:
            d.note("moments of inertia that are zero are those of a thin rod")
    inertial(body, mass, com, moments, axes)
