"""Orientations of many poses in numpy: Bryant angles and rotation matrices."""

from __future__ import annotations

import numpy as np


def principal(pose: np.ndarray) -> np.ndarray:
    """The same poses, (N, 6), with alpha and gamma in (-pi, pi] and beta in [-pi/2, pi/2]."""
    angles = _wrapped(pose[:, 3:])
    flipped = np.abs(angles[:, 1]) > np.pi / 2
    # (alpha, beta, gamma) and (alpha + pi, pi - beta, gamma + pi) are one orientation.
    other = _wrapped(np.array([np.pi, np.pi, np.pi]) + angles * [1, -1, 1])
    return np.hstack([pose[:, :3], np.where(flipped[:, None], other, angles)])


def rotations(angles: np.ndarray) -> np.ndarray:
    """R = Rx(alpha) Ry(beta) Rz(gamma), (N, 3, 3), of (N, 3) [rad]."""
    (ca, cb, cg), (sa, sb, sg) = np.cos(angles).T, np.sin(angles).T
    rows = [
        [cb * cg, -cb * sg, sb],
        [ca * sg + sa * sb * cg, ca * cg - sa * sb * sg, -sa * cb],
        [sa * sg - ca * sb * cg, sa * cg + ca * sb * sg, ca * cb],
    ]
    return np.array(rows).transpose(2, 0, 1)


def bryant_angles(R: np.ndarray) -> np.ndarray:
    """(alpha, beta, gamma), (N, 3) [rad], of rotations (N, 3, 3)."""
    alpha = np.arctan2(-R[:, 1, 2], R[:, 2, 2])
    beta = np.arcsin(np.clip(R[:, 0, 2], -1, 1))
    return np.column_stack([alpha, beta, np.arctan2(-R[:, 0, 1], R[:, 0, 0])])


def _wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles in (-pi, pi]; those that are there already keep their bits."""
    turned = -((np.pi - angles) % (2 * np.pi) - np.pi)
    return np.where((angles > -np.pi) & (angles <= np.pi), angles, turned)
