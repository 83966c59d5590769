"""Internal efforts: those that balance each other and move nothing, but load the contacts.

With n efforts and m freedoms there are n - m directions of them. At home those come first that
change the contact forces the most for their size; elsewhere a direction is the nearest one to its
own at home, so that a slider means the same wherever the platform is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.model import Model

RANK = 1e-10  # of the largest singular value
SAME = 1e-9  # contact forces below this part of a unit effort are none


@dataclass(frozen=True)
class Directions:
    """Internal efforts at one pose.

    effort: (n, r) [N m or N], the largest entry of each direction 1.
    contact: (k, r) [N], what they add to the contact forces.
    """

    effort: np.ndarray
    contact: np.ndarray

    @property
    def count(self) -> int:
        return self.effort.shape[1]


def null_space(J: np.ndarray, normal: np.ndarray) -> Directions:
    """An orthonormal basis of what J^T tau + sum lambda_k N_k = 0 leaves to the efforts.

    Args: J: (n, 6), actuator Jacobian;  normal: (k, 6), wrenches of unit contact forces.
    """
    balance = np.vstack([J, normal]).T
    # Rows are scaled, since moments and forces have units of their own.
    size = np.linalg.norm(balance, axis=1, keepdims=True)
    _, sigma, V = np.linalg.svd(balance / np.where(size > 0, size, 1.0))
    rank = int((sigma > RANK * sigma[0]).sum())
    free = V[rank:].T
    n = len(J)
    basis, R = np.linalg.qr(free[:n])
    return Directions(basis, free[n:] @ np.linalg.inv(R))


def ordered(found: Directions) -> Directions:
    """The same space, those directions first that change the contact forces the most."""
    if not found.contact.size:
        return found
    _, _, V = np.linalg.svd(found.contact)
    return Directions(found.effort @ V.T, found.contact @ V.T)


def aligned(found: Directions, home: Directions) -> Directions:
    """The same space, each direction as near as can be to that of `home`."""
    if found.count != home.count:
        return found
    U, _, V = np.linalg.svd(found.effort.T @ home.effort)
    return Directions(found.effort @ (U @ V), found.contact @ (U @ V))


def scaled(found: Directions) -> Directions:
    """The largest effort of each direction has size 1, so that sliders are in units of efforts."""
    by = np.abs(found.effort).max(axis=0)
    contact = np.where(np.abs(found.contact) < SAME, 0.0, found.contact)
    return Directions(found.effort / by, contact / by)


class Internal:
    """The directions of one model, wherever it is."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._home: Directions | None = None
        self._last = Directions(np.empty((0, 0)), np.empty((0, 0)))

    def at(self, pose: np.ndarray) -> Directions:
        """Directions at X_EE, (6,) [m, rad], at rest; those before where chains cannot reach it."""
        if self._home is None:
            J, normal = self._balance(np.zeros(6))
            self._home = ordered(null_space(J, normal))
            self._last = scaled(self._home)
        J, normal = self._balance(pose)
        if np.isfinite(J).all() and np.isfinite(normal).all():
            self._last = scaled(aligned(null_space(J, normal), self._home))
        return self._last

    def _balance(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Actuator Jacobian (n, 6) and wrenches of unit contact forces (k, 6)."""
        still, none = np.zeros((1, 6)), np.zeros((1, 3))
        ports = {"pose": pose[None], "pose_rate": still, "pose_acceleration": still}
        ports |= {"force": none, "moment": none, "point": none}
        s = self._model.kernel("system").run(ports).values
        return s["J"][..., 0].T, s["normal"][..., 0]
