"""Inverse kinematics of the bundled chewing robot from its file alone, for arrays of poses."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from condyle.mechanism import bundled_text

RAW: dict[str, Any] = tomllib.loads(bundled_text("masticatory"))
Array = np.ndarray
MM = 1e-3


def turned(pose: Array, point: Any) -> Array:
    """Where a platform point [mm] is at poses (N, 6), (N, 3) [m]."""
    return pose[:, :3] + Rotation.from_euler("XYZ", pose[:, 3:]).apply(np.array(point, float) * MM)


def off(pose: Array) -> Array:
    """Distances z - f(x, y) of both condyles, (N, 2)."""
    found = []
    for contact in RAW["contact"]:
        p, surface = turned(pose, contact["point"]), contact["surface"]
        plane = p[:, :2] @ np.array(surface["slope"], float) + surface["offset"] * MM
        found.append(p[:, 2] - plane)
    return np.column_stack(found)


def poses(X: Array, Y: Array, alpha: Array, beta: Array) -> Array:
    """On both planes, by Newton's method from gamma = 0 with differences."""
    pose = np.column_stack([X, Y, 0 * X, alpha, beta, 0 * X])
    for _ in range(30):
        value = off(pose)
        slope = np.empty((len(pose), 2, 2))
        for k, column in enumerate((2, 5)):
            moved = pose.copy()
            moved[:, column] += 1e-7
            slope[:, :, k] = (off(moved) - value) / 1e-7
        pose[:, [2, 5]] -= np.linalg.solve(slope, value[..., None])[..., 0]
    assert np.abs(off(pose)).max() < 1e-13
    return pose


def spare(pose: Array) -> Array:
    """How much each coupler has left, (N, 6) [m]: negative where the crank tip cannot be near or
    far enough, over a whole turn of the crank."""
    found = []
    for chain in RAW["chain"]:
        G, S, M = (np.array(chain[k], float) * MM for k in ("base", "crank_tip", "platform"))
        axis = np.array(chain["axis"], float)
        axis -= axis @ (S - G) * (S - G) / ((S - G) @ (S - G))
        axis /= np.linalg.norm(axis)
        d = turned(pose, chain["platform"]) - G
        along = d @ axis
        across = np.linalg.norm(d - along[:, None] * axis, axis=1)
        crank, coupler = np.linalg.norm(S - G), np.linalg.norm(M - S)
        near, far = np.hypot(across - crank, along), np.hypot(across + crank, along)
        found.append(np.minimum(coupler - near, far - coupler))
    return np.column_stack(found)


def couplers(pose: Array, joint: Array) -> Array:
    """Lengths of the couplers over those of home, less one, where cranks are at joint, (N, 6)."""
    found = []
    for i, chain in enumerate(RAW["chain"]):
        G, S, M = (np.array(chain[k], float) * MM for k in ("base", "crank_tip", "platform"))
        axis = np.array(chain["axis"], float)
        axis -= axis @ (S - G) * (S - G) / ((S - G) @ (S - G))
        turn = Rotation.from_rotvec(joint[:, i, None] * axis / np.linalg.norm(axis))
        length = np.linalg.norm(turned(pose, chain["platform"]) - G - turn.apply(S - G), axis=1)
        found.append(length / np.linalg.norm(M - S) - 1)
    return np.column_stack(found)
