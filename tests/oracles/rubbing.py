"""Actuators and friction by free body diagrams: six equations a sample, written out by numpy.

    C effort + sum_k lambda_k (N_k - sigma_k T_k) = b,

with all bodies cut free and the joints' reactions eliminated by a QR. Losses of the actuators come
from the file's numbers; the point where a ball touches is the foot of its centre on the wall.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from . import newton_euler as ne
from .closure import contact_normals
from .description import Description, Raw, read
from .rotations import platform_motion
from .surfaces import Offset

Array = np.ndarray


@dataclass(frozen=True)
class Balance:
    """One sample. C: (6, n); N, T: (6, k); b: (6,), losses included; loss: (n,).

    touch: (k, 3), where the balls touch, from O_M;  slip, drag: (k, 3), velocity there, and mu u.
    """

    C: Array
    N: Array
    T: Array
    b: Array
    loss: Array
    touch: Array
    slip: Array
    drag: Array

    def along(self, sigma: Sequence[int]) -> Array:
        """Columns of the contact forces under a pattern, (6, k)."""
        return self.N - self.T * np.asarray(sigma, float)

    def rubbing(self) -> list[int]:
        return [i for i, u in enumerate(self.drag) if np.any(u)]

    def patterns(self) -> list[tuple[int, ...]]:
        return patterns(self.drag)


def patterns(drag: Array) -> list[tuple[int, ...]]:
    """Signs of the contact forces, (k,) each; 0 where nothing rubs."""
    return list(product(*((1, -1) if np.any(u) else (0,) for u in drag)))


def losses(raw: Raw, rate: Array, acceleration: Array) -> Array:
    """What the actuators take for themselves, (n,), by the contract's formula."""
    found = []
    for chain, x1, x2 in zip(raw["chain"], rate, acceleration, strict=True):
        a: dict[str, Any] = chain.get("actuator", {})
        inertia = a.get("rotor_inertia", 0.0) * a.get("gear", 1.0) ** 2
        rubbed = a.get("coulomb", 0.0) * x1 / np.hypot(x1, a.get("smoothing_speed", 1e-3))
        found.append(inertia * x2 + a.get("viscous", 0.0) * x1 + rubbed)
    return np.array(found)


def touching(d: Description, raw: Raw, pose: Array, rate: Array) -> tuple[Array, Array, Array]:
    """Where the balls touch from O_M, the platform's velocity there, and mu u; (k, 3) each."""
    motion = platform_motion(pose, rate)
    at, slips, drags = [], [], []
    for contact, table in zip(d.contacts, raw.get("contact", []), strict=True):
        centre = motion.point(contact.point)[0]
        foot = centre
        if isinstance(contact.surface, Offset):
            foot = contact.surface.foot(centre)[0]
        f = table.get("friction", {"coefficient": 0.0})
        c = foot - motion.origin
        v = motion.velocity + np.cross(motion.omega, c)
        speed = np.sqrt(v @ v + f.get("smoothing_speed", 1e-3) ** 2)
        at.append(c)
        slips.append(v)
        drags.append(f["coefficient"] * v / speed)
    return tuple(np.array(a).reshape(-1, 3) for a in (at, slips, drags))  # type: ignore[return-value]


def balance(
    raw: Raw, pose: Array, rate: Array, second: Array, wrench: Array, where: str | Array | None
) -> Balance:
    """The equations of one sample; wrench: force and moment on the platform at `where`."""
    d = read(raw)
    motion = platform_motion(pose, rate, second)
    bodies, links, (_, x1, x2) = ne.cut_free(d, motion, wrench, where)
    touch, slip, drag = touching(d, raw, pose, rate)
    pushes, rubs = [], []
    normals = contact_normals(d, motion)
    for contact, n, c, u in zip(d.contacts, normals, touch, drag, strict=True):
        centre = motion.point(contact.point)[0]
        pushes.append(ne.Link(contact.name, "platform", "base", centre, force=n[:, None]))
        at = motion.origin + c
        rubs.append(ne.Link(contact.name, "platform", "base", at, force=u[:, None]))
    joined = [[link for link in links if link.known is known] for known in (False, True)]
    A, C, N, T = (ne._columns(part, bodies, d.size) for part in (*joined, pushes, rubs))
    b = np.concatenate([np.append(body.force, body.moment / d.size) for body in bodies])
    free = np.linalg.qr(A, mode="complete")[0][:, A.shape[1] :] if A.shape[1] else np.eye(len(b))
    C, N, T, b = (free.T @ part for part in (C, N, T, b))
    loss = losses(raw, x1, x2)
    return Balance(C, N, T, b + C @ loss, loss, touch, slip, drag)
