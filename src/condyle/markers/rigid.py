"""Rigid bodies of markers: where a body is, by least squares, though some markers are not seen."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from ..mechanism.coordinates import bryant_angles

FEWEST = 3  # markers that hold a body
FLATTEST = 0.03  # breadth over length of a body whose turn about its length can still be told
_ROUNDS, _SETTLED = 20, 1e-13
_ALL_ORDERS = 5  # maximum number of markers of a body whose orders are all tried


@dataclass(frozen=True, eq=False)
class RigidFit:
    """A body at F frames: x = rotation s + position of every point s of its shape.

    Attributes: rotation: (F, 3, 3);  position: (F, 3); NaN at frames that do not determine them.
                residual: (F, m), distance of each marker from its place in the body; NaN where it
                    was not seen, or the body is not determined.
    """

    rotation: np.ndarray
    position: np.ndarray
    residual: np.ndarray

    @property
    def determined(self) -> np.ndarray:
        """Frames where the body is determined, (F,)."""
        return np.isfinite(self.position[:, 0])

    def largest(self) -> np.ndarray:
        """Largest residual of each frame, (F,); NaN where the body is not determined."""
        known = np.where(np.isfinite(self.residual), self.residual, -1.0).max(axis=1)
        return np.where(self.determined, known, np.nan)

    def back(self, points: np.ndarray) -> np.ndarray:
        """Points (F, n, 3) as they stand to the body: R^T (x - p)."""
        return np.einsum("fji,fnj->fni", self.rotation, points - self.position[:, None])


def fit(shape: np.ndarray, points: np.ndarray) -> RigidFit:
    """The rotation and translation of least sum of squares, of every frame for itself (Kabsch).

        min sum |R s_i + p - x_i|^2 over the markers seen:  R = V diag(1, 1, det V U^T) U^T,
        U S V^T = sum (s_i - s_mean)(x_i - x_mean)^T

    Args: shape: places of the markers in the body, (m, 3).
          points: where they were seen, (F, m, 3); NaN where not.
    """
    seen = np.isfinite(points).all(axis=-1)
    weight = seen[..., None].astype(float)
    count = np.maximum(seen.sum(axis=1), 1)[:, None]
    x = np.where(seen[..., None], points, 0.0)
    s_mean, x_mean = (weight * shape).sum(axis=1) / count, x.sum(axis=1) / count
    s = weight * (shape - s_mean[:, None])
    x = x - x_mean[:, None]  # of markers not seen it meets zeros in s
    U, _, Vt = np.linalg.svd(np.einsum("fmi,fmj->fij", s, x))
    V = Vt.transpose(0, 2, 1)
    V[..., 2] *= np.sign(np.linalg.det(V @ U.transpose(0, 2, 1)))[:, None]
    R = V @ U.transpose(0, 2, 1)
    residual = np.linalg.norm(np.einsum("fij,fmj->fmi", R, s) - x, axis=-1)
    known = (seen.sum(axis=1) >= FEWEST) & (breadth(s) > FLATTEST)
    return RigidFit(
        np.where(known[:, None, None], R, np.nan),
        np.where(known[:, None], x_mean - np.einsum("fij,fj->fi", R, s_mean), np.nan),
        np.where(seen & known[:, None], residual, np.nan),
    )


def breadth(centred: np.ndarray) -> np.ndarray:
    """How far points about their mean, (..., m, 3), are from a line: 0 on it, 1 where as broad as
    long."""
    sigma = np.linalg.svd(centred, compute_uv=False)
    return sigma[..., 1] / np.maximum(sigma[..., 0], np.finfo(float).tiny)


def common_shape(points: np.ndarray) -> np.ndarray:
    """The shape that frames (H, m, 3) have in common, (m, 3), where it was on the whole.

    The mean of the frames, each moved onto it as a rigid body: so a body that moves meanwhile
    keeps its size. NaN for a marker that was never seen beside three others.
    """
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(points).all(axis=-1)
        shape = _mean(points)
        there = seen.any(axis=0)
        if there.sum() < FEWEST:
            return shape
        for _ in range(_ROUNDS):
            body = fit(shape[there], points[:, there])
            if not body.determined.any():
                return shape
            moved = _mean(body.back(points[:, there]))
            if np.isnan(moved).any():
                moved = np.where(np.isnan(moved), shape[there], moved)
            change = np.abs(moved - shape[there]).max()
            shape[there] = moved
            if change <= _SETTLED * np.abs(moved).max():
                break
    return shape


def orders(sizes: list[int]) -> list[list[int]]:
    """Orders of all markers: as labelled; every pair exchanged; every order of a small body.

    Args: sizes: numbers of the bodies' markers, in their order.
    """
    plain = list(range(sum(sizes)))
    all_orders = [plain]
    for i, k in combinations(plain, 2):
        all_orders.append([k if j == i else i if j == k else j for j in plain])
    for start, size in zip(np.cumsum([0, *sizes]), sizes, strict=False):
        here = permutations(plain[start : start + size]) if size <= _ALL_ORDERS else ()
        all_orders += [[*plain[:start], *p, *plain[start + size :]] for p in here]
    return all_orders


def continuous_angles(rotation: np.ndarray) -> np.ndarray:
    """Bryant angles, (F, 3) [rad], continuous from frame to frame; NaN stays NaN."""
    angles = bryant_angles(rotation)
    known = np.isfinite(angles).all(axis=1)
    angles[known] = np.unwrap(angles[known], axis=0)
    return angles


def _mean(points: np.ndarray) -> np.ndarray:
    """Mean over frames of what was seen, (m, 3)."""
    seen = np.isfinite(points).all(axis=-1)
    total = np.where(seen[..., None], points, 0.0).sum(axis=0)
    count = seen.sum(axis=0)[:, None]
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def quaternion_rotations(Q: np.ndarray) -> np.ndarray:
    """Rotations (F, 3, 3) of unit quaternions (x, y, z, w), (F, 4)."""
    v, w = Q[:, :3], Q[:, 3, None, None]
    cross = np.cross(np.eye(3)[None], v[:, None]).transpose(0, 2, 1)
    eye = np.eye(3)
    inner = (v * v).sum(axis=1)[:, None, None]
    turned: np.ndarray = (w * w - inner) * eye + 2 * v[:, :, None] * v[:, None] - 2 * w * cross
    return turned
