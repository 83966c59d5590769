"""Gauss-Newton steps from a pose towards joint coordinates, on the surfaces of the contacts.

    X <- X + M_J dq + dX_phi,    A dq ~ theta - theta(X) - J_theta dX_phi,    A = J_theta M_J,

where dX_phi moves the dependent coordinates back onto the surfaces. n joints over-determine the
6 - k freedoms, so ~ is least squares. Joints that turn are multiplied by the characteristic
length, and so are angles of the pose: A has no dimension.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, fields

import numpy as np

from ...kinematics.chain import FAMILIES
from ...kinematics.constraints import indices
from ...mechanism.home import characteristic_length, dependent_coordinates
from ...mechanism.mechanism import Mechanism
from .joint_map import joint_map

ROUNDING = 4e-15  # of a joint coordinate, in the mechanism's own size, with what A makes of it


@dataclass(frozen=True)
class Step:
    """One step at N poses.

    move:     of X_EE, (N, 6); NaN where there is none.
    size:     its largest entry, (N,), in characteristic lengths and radians.
    residual: (N, n), given less computed joint coordinates [rad or m].
    error:    (N,), norm of the residual and of the distance from the surfaces [m].
    A:        (N, n, m).
    settled:  (N,), whether the step changes joints by no more than rounding.
    """

    move: np.ndarray
    size: np.ndarray
    residual: np.ndarray
    error: np.ndarray
    A: np.ndarray
    settled: np.ndarray

    def of(self, samples: np.ndarray) -> Step:
        """The steps of some samples, by index or mask."""
        return Step(*(getattr(self, f.name)[samples] for f in fields(self)))

    def put(self, samples: np.ndarray, other: Step) -> None:
        """Steps of some samples anew."""
        for f in fields(self):
            getattr(self, f.name)[samples] = getattr(other, f.name)


class GaussNewton:
    """Steps for one mechanism."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.length = characteristic_length(mechanism)
        families = [FAMILIES[chain.kind] for chain in mechanism.chains]
        self._turning = np.array([family.joint_unit == "rad" for family in families])
        self._weight = np.where(self._turning, self.length, 1.0) / self.length
        self._unit = np.repeat([self.length, 1.0], 3)
        dependent = indices(dependent_coordinates(mechanism))
        self._free = np.delete(self._unit, dependent)
        self._map = joint_map(mechanism)

    def step(self, pose: np.ndarray, joints: np.ndarray) -> Step:
        """Steps from poses (N, 6) towards joint coordinates (N, n)."""
        at = self._map(pose)
        residual = self.turn(joints - at.joint)
        A = (at.J_theta @ at.M_J) * self._weight[:, None] * self._free
        right = (residual - (at.J_theta @ at.correction[..., None])[..., 0]) * self._weight
        dq = least_squares(A, right[..., None])
        move = at.correction + (at.M_J @ (dq * self._free[:, None]))[..., 0]
        change = np.abs(A @ dq)[..., 0]
        noise = ROUNDING * (1 + np.abs(A).sum(axis=2))
        settled = (change <= noise).all(axis=1)
        settled &= (np.abs(at.phi) <= ROUNDING * self.length).all(axis=1)
        squares = ((residual * self._weight * self.length) ** 2).sum(axis=1)
        error = np.sqrt(squares + (at.phi**2).sum(axis=1))
        return Step(move, self.size(move), residual, error, A, settled)

    def joints(self, pose: np.ndarray) -> np.ndarray:
        """Joint coordinates of poses, (N, n)."""
        return self._map(pose).joint

    def turn(self, difference: np.ndarray) -> np.ndarray:
        """Differences of joint coordinates, (N, n), without whole turns."""
        turns = np.round(difference / (2 * np.pi)) * (2 * np.pi)
        return np.where(self._turning, difference - turns, difference)

    def between(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """The way from one pose to another, (N, 6), without whole turns."""
        way = other - one
        way[:, 3:] -= np.round(way[:, 3:] / (2 * np.pi)) * (2 * np.pi)
        return way

    def size(self, way: np.ndarray) -> np.ndarray:
        """Largest entry of ways of the pose, (N,), in characteristic lengths and radians."""
        return np.abs(way / self._unit).max(axis=1)


def least_squares(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """x with A x ~ b for each sample, (N, m, c) from (N, n, m) and (N, n, c); NaN where A fails."""
    x = np.full((len(A), A.shape[2], b.shape[2]), np.nan)
    good = np.flatnonzero(np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=(1, 2)))
    if not good.size:
        return x
    square, right = A[good], b[good]
    if A.shape[1] > A.shape[2]:
        Q, square = np.linalg.qr(square)
        right = Q.transpose(0, 2, 1) @ right
    try:
        x[good] = np.linalg.solve(square, right)
    except np.linalg.LinAlgError:
        for i, R, y in zip(good, square, right, strict=True):
            with suppress(np.linalg.LinAlgError):
                x[i] = np.linalg.solve(R, y)
    return x
