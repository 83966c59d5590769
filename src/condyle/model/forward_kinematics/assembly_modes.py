"""The assembly modes of a mechanism: all poses, as far as found, with the same joint coordinates.

From many random starts about home, damped Gauss-Newton runs to the nearest pose; those that fit
the joints are kept once each. The search is seeded, so it repeats, and it may miss modes: those
that few starts lead to, and those of other chains' branches than home's, which are not looked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...kinematics.pose_finder import DAMPED, find
from ...mechanism.coordinates import bryant_angles, rotations
from ...mechanism.mechanism import Mechanism
from .joint_steps import JointSteps
from .orientation import principal
from .pose_status import PoseStatus, judge

STARTS = 2000  # maximum number of starts that chains can reach
DRAWN = 20000  # poses drawn to find them
WIDTHS = 4  # of boxes, each half as wide as the one before
SAME = 1e-6  # modes closer than this are one, in characteristic lengths and entries of R


@dataclass(frozen=True)
class AssemblyModes:
    """M poses of one sample of joint coordinates, the nearest to home first.

    pose:      X_EE, (M, 6) [m, rad].
    distance:  from home, (M,): root of squares of O_M's way in characteristic lengths and of the
               angle of the rotation [rad].
    residual:  (M, n), given less computed joint coordinates [rad or m].
    condition: (M,), condition number of the joints' rates on twists, without dimension.
    """

    pose: np.ndarray
    distance: np.ndarray
    residual: np.ndarray
    condition: np.ndarray


def search(
    mechanism: Mechanism, steps: JointSteps, joints: np.ndarray, seed: int, tolerance: float
) -> AssemblyModes:
    """Poses of joint coordinates, (n,), that fit within `tolerance` [rad or m]."""
    starts = _starts(mechanism, np.random.default_rng(seed))
    starts = starts[np.isfinite(steps.conditions(starts).value).all(axis=1)][:STARTS]
    given = np.tile(joints, (len(starts), 1))
    pose, converged = find(steps, starts, given, DAMPED)
    pose, given = principal(pose[converged]), given[converged]
    residual = steps.step(pose, given).residual
    pose = pose[judge(np.ones(len(pose), bool), residual, tolerance) == PoseStatus.OK]
    R = rotations(pose[:, 3:])
    turn = np.arccos(np.clip((np.trace(R, axis1=1, axis2=2) - 1) / 2, -1, 1))
    distance = np.hypot(np.linalg.norm(pose[:, :3], axis=1) / steps.length, turn)
    place = np.hstack([pose[:, :3] / steps.length, R.reshape(-1, 9)])
    modes: list[int] = []
    for i in np.argsort(distance, kind="stable"):
        if not modes or (np.abs(place[modes] - place[i]).max(axis=1) > SAME).all():
            modes.append(int(i))
    at = steps.step(pose[modes], given[: len(modes)])
    condition = steps.condition(pose[modes]) if modes else np.zeros(0)
    return AssemblyModes(pose[modes], distance[modes], at.residual, condition)


def _starts(mechanism: Mechanism, rng: np.random.Generator) -> np.ndarray:
    """Poses about home, (N, 6): home itself, then boxes up to twice as far as the base reaches."""
    points = [chain.base for chain in mechanism.chains]
    width = 2 * np.linalg.norm(points, axis=1).max() * 0.5 ** (np.arange(DRAWN) % WIDTHS)
    place = rng.uniform(-1, 1, (DRAWN, 3)) * width[:, None]
    axis = rng.normal(size=(DRAWN, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    half = rng.uniform(0, np.pi / 2, DRAWN)
    w, v = np.cos(half)[:, None, None], axis * np.sin(half)[:, None]
    x, y, z = v.T
    zero = np.zeros(DRAWN)
    skew = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    R = np.eye(3) + 2 * w * skew + 2 * skew @ skew  # Rodrigues, of a unit quaternion (w, v)
    starts = np.hstack([place, bryant_angles(R)])
    starts[0] = 0.0
    return starts
