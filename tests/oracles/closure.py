"""Contacts: dependent coordinates, whole states from independent ones, and the split of forces."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.linalg import null_space

from .description import COORDINATES, Description, Raw, read
from .rotations import Motion, platform_motion
from .surfaces import normal

Array = np.ndarray


def contact_rows(d: Description, motion: Motion) -> Array:
    """C = d phi / d X_EE, (k, 6)."""
    rows = [
        c.surface.gradient(motion.point(c.point)[0]) @ motion.jacobian(c.point) for c in d.contacts
    ]
    return np.array(rows).reshape(-1, 6)


def residuals(d: Description, pose: Array) -> Array:
    """phi of every contact, (k,), [m]."""
    motion = platform_motion(pose)
    return np.array([c.surface.value(motion.point(c.point)[0]) for c in d.contacts])


def dependent_coordinates(description: Raw | Description) -> tuple[str, ...]:
    """The file's `dependent`, else the rule of formats.md.

    First set in the order Z, gamma, alpha, beta, Y, X whose columns of C at home have a condition
    number below 1e4, angles made lengths by the characteristic length.
    """
    d = read(description)
    if d.dependent is not None:
        return d.dependent
    scale = dict.fromkeys("XYZ", 1.0) | dict.fromkeys(("alpha", "beta", "gamma"), d.size)
    C = contact_rows(d, platform_motion(np.zeros(6))) / [scale[name] for name in COORDINATES]
    for names in combinations(("Z", "gamma", "alpha", "beta", "Y", "X"), len(d.contacts)):
        columns = C[:, [COORDINATES.index(name) for name in names]]
        if not names or np.linalg.cond(columns) < 1e4:
            return names
    raise ValueError("the contacts do not hold: no set of dependent coordinates")


def independent_coordinates(description: Raw | Description) -> tuple[str, ...]:
    """The other 6 - k, in the order of X_EE."""
    dependent = dependent_coordinates(description)
    return tuple(name for name in COORDINATES if name not in dependent)


def complete_state(
    description: Raw | Description,
    names: Sequence[str],
    q: Array | Sequence[float],
    qd: Array | Sequence[float],
    qdd: Array | Sequence[float],
    steps: int = 4,
) -> tuple[Array, Array, Array]:
    """Pose, its rate and its second derivative, (6,) each, from any valid 6 - k coordinates.

    Newton on the others, led from home in `steps` pieces; then C X' = 0 and C X'' = -C' X'.
    """
    d = read(description)
    free = [COORDINATES.index(name) for name in names]
    held = [i for i in range(6) if i not in free]
    pose, rate, second = np.zeros((3, 6))
    for part in np.linspace(0, 1, steps + 1)[1:]:
        pose[free] = part * np.asarray(q)
        for _ in range(40 if held else 0):
            C = contact_rows(d, platform_motion(pose))
            step = np.linalg.solve(C[:, held], -residuals(d, pose))
            pose[held] += step
            if np.abs(step).max() < 1e-15:
                break
    if held and not np.abs(residuals(d, pose)).max() < 1e-12:
        raise ValueError("no pose on the contacts near home")
    rate[free], second[free] = qd, qdd
    if held:
        C = contact_rows(d, platform_motion(pose))
        rate[held] = np.linalg.solve(C[:, held], -C[:, free] @ rate[free])
        motion = platform_motion(pose, rate)  # with X'' = 0: what is left is C' X'
        bias = []
        for c in d.contacts:
            p, v, a = motion.point(c.point)
            bias.append(v @ c.surface.hessian(p) @ v + c.surface.gradient(p) @ a)
        second[held] = np.linalg.solve(C[:, held], -C[:, free] @ second[free] - np.array(bias))
    return pose, rate, second


def contact_normals(d: Description, motion: Motion) -> Array:
    """Unit normals at the contacts, (k, 3)."""
    rows = [normal(c.surface, motion.point(c.point)[0]) for c in d.contacts]
    return np.array(rows).reshape(-1, 3)


def distribute(Q: Array, J: Array, N: Array, size: float) -> tuple[Array, Array]:
    """Minimum-norm tau and contact forces of Q = J' tau + N' force.

    Q (6,) is dual to X_EE, J (n, 6) = d joint / d X_EE, N (k, 6) = n . d point / d X_EE.
    """
    scale = np.array([1, 1, 1, size, size, size])  # angles as lengths: a well scaled null space
    Q, J, N = Q / scale, J / scale, N / scale
    free = null_space(N) if len(N) else np.eye(6)
    tau = np.linalg.lstsq(free.T @ J.T, free.T @ Q, rcond=1e-14)[0]
    force = np.linalg.lstsq(N.T, Q - J.T @ tau, rcond=None)[0] if len(N) else np.zeros(0)
    return tau, force
