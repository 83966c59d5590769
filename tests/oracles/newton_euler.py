"""Plain Newton-Euler from free body diagrams: every body cut free, every joint force an unknown.

For each body: sum of forces = m (a - g), sum of moments about its mass centre
= I omega' + omega x I omega. Two spherical joints leave a rod free to spin; the description holds
it to N_i0 Ry(beta_i) Rz(gamma_i), which takes a moment along the one axis across both swing axes,
Ry X. It comes from the base: a guide.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .closure import contact_normals
from .description import (
    Chain,
    Description,
    Raw,
    Rod,
    joint,
    read,
    rod_angles,
    rod_rotation,
    swing_axes,
)
from .rotations import Motion, bryant, platform_motion

Array = np.ndarray
NONE = np.zeros((3, 0))


@dataclass(frozen=True)
class Body:
    name: str
    com: Array
    force: Array  # m (a - g)
    moment: Array  # I omega' + omega x I omega, about the mass centre


@dataclass(frozen=True)
class Link:
    """What body `by` does to body `on`: forces at `point` and moments, along the columns."""

    name: str
    on: str
    by: str
    point: Array
    force: Array = field(default_factory=lambda: NONE)
    moment: Array = field(default_factory=lambda: NONE)
    known: bool = False  # an actuator: not an unknown reaction

    @property
    def size(self) -> int:
        return self.force.shape[1] + self.moment.shape[1]


@dataclass(frozen=True)
class Path:
    """A moving vector and its first two time derivatives."""

    x: Array
    v: Array
    a: Array

    def __sub__(self, other: Path) -> Path:
        return Path(self.x - other.x, self.v - other.v, self.a - other.a)


def _across(axis: Array) -> Array:
    """Two unit vectors perpendicular to a unit axis, (3, 2)."""
    return np.linalg.svd(axis[None])[2][1:].T


def drive_motion(chain: Chain, P: Path) -> tuple[Path, Array]:
    """Motion of S and (joint coordinate, rate, acceleration), from that of the platform joint.

    The rod e = P - S keeps its length: e.(P' - S') = 0 and e.(P'' - S'') + |P' - S'|^2 = 0.
    """
    x, S = joint(chain, P.x)
    e = P.x - S
    if chain.kind in ("SPS", "cable"):
        length, sign = np.linalg.norm(e), -1 if chain.kind == "cable" else 1
        rate = e @ P.v / length
        second = (P.v @ P.v + e @ P.a - rate**2) / length
        return Path(S, np.zeros(3), np.zeros(3)), np.array([x, sign * rate, sign * second])
    t, curve = chain.axis, np.zeros(3)  # dS/dx, d2S/dx2
    if chain.kind == "RSS":
        t, curve = np.cross(chain.axis, S - chain.G), chain.G - S
    rate = e @ P.v / (e @ t)
    slip = P.v - t * rate
    second = (e @ (P.a - curve * rate**2) + slip @ slip) / (e @ t)
    return Path(S, t * rate, t * second + curve * rate**2), np.array([x, rate, second])


def rod_motion(chain: Chain, e: Path) -> tuple[Array, Array, Array, Array]:
    """Rotation, omega, omega' of the rod, and the axis of its guide, from the motion of M - S.

    In N_i0 the direction is (cos b cos g, sin g, -sin b cos g); omega = beta' Y + gamma' Z_gamma.
    """
    length = np.linalg.norm(e.x)
    u = e.x / length
    stretch = u @ e.v
    du = (e.v - u * stretch) / length
    ddu = (e.a - u * (u @ e.a + du @ e.v) - du * 2 * stretch) / length
    beta, gamma = rod_angles(chain, e.x)
    R = rod_rotation(chain, beta, gamma)
    about_beta, about_gamma = swing_axes(chain, beta)
    along = np.stack([np.cross(about_beta, u), np.cross(about_gamma, u)], axis=1)  # u' per rate
    rates = np.linalg.lstsq(along, du, rcond=None)[0]
    omega = about_beta * rates[0] + about_gamma * rates[1]
    coriolis = np.cross(about_beta, about_gamma) * rates[0] * rates[1]
    left = ddu - np.cross(coriolis, u) - np.cross(omega, du)
    seconds = np.linalg.lstsq(along, left, rcond=None)[0]
    omega_rate = about_beta * seconds[0] + about_gamma * seconds[1] + coriolis
    guide = chain.N0 @ bryant([0.0, beta, 0.0])[:, 0]
    return R, omega, omega_rate, guide


def _spin(I: Array, omega: Array, omega_rate: Array) -> Array:
    return I @ omega_rate + np.cross(omega, I @ omega)


def _rod_body(
    name: str, rod: Rod, end: Path, R: Array, omega: Array, omega_rate: Array, gravity: Array
) -> Body:
    r = R[:, 0] * (rod.com if rod.origin == "S" else -rod.com)
    a = end.a + np.cross(omega_rate, r) + np.cross(omega, np.cross(omega, r))
    moment = _spin(R @ rod.inertia @ R.T, omega, omega_rate)
    return Body(name, end.x + r, rod.mass * (a - gravity), moment)


def _chain(chain: Chain, P: Path, gravity: Array) -> tuple[list[Body], list[Link], Array]:
    """Bodies, links and (joint coordinate, rate, acceleration) of a chain."""
    S, x = drive_motion(chain, P)
    if chain.kind == "cable":  # nothing but a tension that pulls the platform to the base
        pull = (S.x - P.x) / np.linalg.norm(S.x - P.x)
        tension = Link(f"{chain.name}.tau", "platform", "base", P.x, pull[:, None], known=True)
        return [], [tension], x
    R, omega, omega_rate, guide = rod_motion(chain, P - S)
    name, every, axis, still = chain.name, np.eye(3), R[:, 0], np.zeros(3)
    if chain.kind == "SPS":
        cylinder, piston = f"{name}.cylinder", f"{name}.piston"
        bodies = [
            _rod_body(cylinder, chain.rods[0], S, R, omega, omega_rate, gravity),
            _rod_body(piston, chain.rods[1], P, R, omega, omega_rate, gravity),
        ]
        links = [
            Link(f"{name}.S", cylinder, "base", S.x, force=every),
            Link(f"{name}.guide", cylinder, "base", S.x, moment=guide[:, None]),
            Link(f"{name}.sleeve", piston, cylinder, P.x, _across(axis), every),
            Link(f"{name}.tau", piston, cylinder, P.x, force=axis[:, None], known=True),
            Link(f"{name}.M", "platform", piston, P.x, force=every),
        ]
        return bodies, links, x
    rod, drive = f"{name}.rod", f"{name}.drive"
    if chain.kind == "RSS":  # the crank's mass is on the shaft and not in the file: no weight
        body = Body(drive, chain.G, still, chain.drive * x[2] * chain.axis)
        bearing = Link(f"{name}.bearing", drive, "base", chain.G, every, _across(chain.axis))
        motor = Link(f"{name}.tau", drive, "base", chain.G, moment=chain.axis[:, None], known=True)
    else:
        body = Body(drive, S.x, chain.drive * (S.a - gravity), still)
        bearing = Link(f"{name}.bearing", drive, "base", S.x, _across(chain.axis), every)
        motor = Link(f"{name}.tau", drive, "base", S.x, force=chain.axis[:, None], known=True)
    links = [
        bearing,
        motor,
        Link(f"{name}.S", rod, drive, S.x, force=every),
        Link(f"{name}.guide", rod, "base", S.x, moment=guide[:, None]),
        Link(f"{name}.M", "platform", rod, P.x, force=every),
    ]
    return [body, _rod_body(rod, chain.rods[0], S, R, omega, omega_rate, gravity)], links, x


def _columns(links: list[Link], bodies: list[Body], size: float) -> Array:
    """Six rows a body, force then moment / size; a column for each unknown of each link."""
    row = {body.name: 6 * i for i, body in enumerate(bodies)}
    A, at = np.zeros((6 * len(bodies), sum(link.size for link in links))), 0
    for link in links:
        split, end = at + link.force.shape[1], at + link.size
        for name, sign in ((link.on, 1.0), (link.by, -1.0)):
            if name == "base":
                continue
            i, body = row[name], bodies[row[name] // 6]
            arm = link.point - body.com
            A[i : i + 3, at:split] = sign * link.force
            A[i + 3 : i + 6, at:split] = sign * np.cross(arm, link.force, axisb=0, axisc=0) / size
            A[i + 3 : i + 6, split:end] = sign * link.moment / size
        at = end
    return A


def inverse_dynamics(
    description: Raw | Description,
    pose: Array,
    pose_rate: Array,
    pose_acceleration: Array,
    wrench: Array,
    load_point: str | Array | None = "right_molar",
    tau: Array | None = None,
) -> dict[str, Any]:
    """All forces of one sample, SI.

    Args:    wrench: force and moment on the platform at `load_point`, (6,) in {S};
             tau: actuator efforts of a redundant mechanism; minimum 2-norm when not given.
    Returns: tau, joint, joint_rate, joint_acceleration, (n,); contact, (k,);
             reactions: name -> (force, moment), components in {S}, without tau:
             `<chain>.M` on the platform by the rod;
             `<chain>.S` on the rod (SPS: cylinder) by crank, slider or base;
             `<chain>.bearing` on crank or slider by the base, moment about G or S;
             `<chain>.sleeve` on the piston by the cylinder, moment about M;
             `<chain>.guide` on the rod by the base, see above; `<contact>` on the platform;
             residual: largest imbalance over the largest force.
    """
    d = read(description)
    motion = platform_motion(*(np.asarray(x, float) for x in (pose, pose_rate, pose_acceleration)))
    bodies, links, joints = cut_free(d, motion, wrench, load_point)
    for contact, n in zip(d.contacts, contact_normals(d, motion), strict=True):
        point = motion.point(contact.point)[0]
        links.append(Link(contact.name, "platform", "base", point, force=n[:, None]))
    motors = [link for link in links if link.known]
    reactions = [link for link in links if not link.known]
    A, A_tau = _columns(reactions, bodies, d.size), _columns(motors, bodies, d.size)
    b = np.concatenate([np.append(body.force, body.moment / d.size) for body in bodies])
    if tau is None:  # the balances left when all reactions are eliminated: 6 - k
        free = np.linalg.qr(A, mode="complete")[0][:, A.shape[1] :]
        tau = np.linalg.lstsq(free.T @ A_tau, free.T @ b, rcond=1e-14)[0]
    x = np.linalg.lstsq(A, b - A_tau @ tau, rcond=None)[0]
    gap = np.abs(A @ x + A_tau @ tau - b).max() / max(np.abs(b).max(), np.abs(x).max(initial=0.0))
    forces = _named(reactions, x)
    pushes = np.array([forces[c.name][0] for c in d.contacts]).reshape(-1, 3)
    position, rate, second = joints
    return {
        "tau": tau,
        "contact": np.sum(pushes * contact_normals(d, motion), axis=1),
        "joint": position,
        "joint_rate": rate,
        "joint_acceleration": second,
        "reactions": forces,
        "residual": float(gap),
    }


def cut_free(
    d: Description, motion: Motion, wrench: Array, where: str | Array | None
) -> tuple[list[Body], list[Link], Array]:
    """Platform and chains: bodies, links, and joint coordinates, rates, accelerations, (3, n)."""
    bodies, links, joints = [_platform(d, motion, wrench, where)], [], []
    for chain in d.chains:
        more, joined, x = _chain(chain, Path(*motion.point(chain.M)), d.gravity)
        bodies, links, joints = bodies + more, links + joined, [*joints, x]
    return bodies, links, np.array(joints).T


def _platform(d: Description, motion: Motion, wrench: Array, where: str | Array | None) -> Body:
    """The platform; the load is moved to its mass centre and to the right-hand side."""
    F, couple = np.asarray(wrench[:3], float), np.asarray(wrench[3:], float)
    R, arm = motion.R, motion.R @ d.load_point(where)
    force = d.mass * (motion.acceleration - d.gravity) - F
    moment = _spin(R @ d.inertia @ R.T, motion.omega, motion.omega_rate) - np.cross(arm, F) - couple
    return Body("platform", motion.origin, force, moment)


def _named(links: list[Link], x: Array) -> dict[str, tuple[Array, Array]]:
    named, at = {}, 0
    for link in links:
        split = at + link.force.shape[1]
        named[link.name] = link.force @ x[at:split], link.moment @ x[split : at + link.size]
        at += link.size
    return named
