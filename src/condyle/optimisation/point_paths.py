"""A point of the platform near places: a tooth on its path.

y = |p(q) - place|^2 / radius^2,    p = O_M + R point,    p' = O_M' + omega x R point
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Track:
    """place: (N, 3) in {S} [m], NaN at nodes where the point is free;  point: (3,) in {M} [m]."""

    name: str
    point: Array
    place: Array
    within: float

    def _arm(self, pose: Array) -> Array:
        """R point, (..., N, 3)."""
        turned = Rotation.from_euler("XYZ", pose[..., 3:].reshape(-1, 3)).apply(self.point)
        found: Array = turned.reshape(*pose.shape[:-1], 3)
        return found

    def outputs(self, pose: Array) -> Array:
        """Outputs at poses X_EE (..., N, 6), (..., N, 3); 0 where the point is free."""
        away = (pose[..., :3] + self._arm(pose) - self.place) / self.within
        return np.where(np.isfinite(self.place), away, 0.0)

    def slopes(self, pose: Array, by_q: Array) -> Array:
        """Slopes by q, of the poses' slopes (..., N, 6, m): (..., N, 3, m)."""
        arm = self._arm(pose)
        (alpha, beta), none = np.moveaxis(pose[..., 3:5], -1, 0), np.zeros(pose.shape[:-1])
        c, s = np.cos(alpha), np.sin(alpha)
        axes = (
            (none + 1, none, none),
            (none, c, s),
            (np.sin(beta), -s * np.cos(beta), c * np.cos(beta)),
        )
        turns = [np.cross(np.stack(axis, axis=-1), arm) for axis in axes]
        found: Array = (
            by_q[..., :3, :] + np.stack(turns, axis=-1) @ by_q[..., 3:, :]
        ) / self.within
        return np.where(np.isfinite(self.place)[..., None], found, 0.0)
