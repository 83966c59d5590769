"""Principal values of a pose's angles: equal poses have equal angles."""

from __future__ import annotations

import numpy as np


def principal(pose: np.ndarray) -> np.ndarray:
    """The same poses, (N, 6), with alpha and gamma in (-pi, pi] and beta in [-pi/2, pi/2]."""
    angles = _wrapped(pose[:, 3:])
    flipped = np.abs(angles[:, 1]) > np.pi / 2
    # (alpha, beta, gamma) and (alpha + pi, pi - beta, gamma + pi) are one orientation.
    other = _wrapped(np.array([np.pi, np.pi, np.pi]) + angles * [1, -1, 1])
    return np.hstack([pose[:, :3], np.where(flipped[:, None], other, angles)])


def _wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles in (-pi, pi]; those that are there already keep their bits."""
    turned = -((np.pi - angles) % (2 * np.pi) - np.pi)
    return np.where((angles > -np.pi) & (angles <= np.pi), angles, turned)
