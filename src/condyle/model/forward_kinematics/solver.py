"""Forward kinematics: from joint coordinates, as encoders give them, to the pose.

n joint coordinates over-determine a pose that the contacts leave 6 - k freedoms. The pose is the
one on the contacts whose joints are nearest in the least-squares sense, with angles multiplied by
the characteristic length, and of the assembly mode that leads there from home (`follow`) or, with
times, from the row before (`track`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...mechanism.mechanism import Mechanism
from ..continuation import follow
from .assembly_modes import AssemblyModes, search
from .joint_steps import joint_steps
from .orientation import principal
from .pose_status import PoseStatus, judge
from .track import track

TOLERANCE = 1e-6  # of a joint [rad or m]


@dataclass(frozen=True)
class ForwardSolution:
    """Poses of N samples.

    pose:      X_EE, (N, 6) [m, rad], angles in (-pi, pi]; NaN unless the status is ok.
    residual:  (N, n): given less computed joint coordinates [rad or m]; NaN where none was reached.
    condition: (N,), condition number of the dimensionless actuator Jacobian; NaN as the pose.
    status:    (N,), of `PoseStatus`.
    """

    pose: np.ndarray
    residual: np.ndarray
    condition: np.ndarray
    status: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """Where the status is ok, (N,)."""
        return np.asarray(self.status == PoseStatus.OK)


class ForwardKinematics:
    """Solves poses of one mechanism from its joint coordinates."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._steps = joint_steps(mechanism)

    def solve(
        self,
        joints: np.ndarray,
        time: np.ndarray | None = None,
        tolerance: float = TOLERANCE,
    ) -> ForwardSolution:
        """Poses from joint coordinates.

        Args:   joints:    (N, n) [rad or m], zero at home; turning joints may count whole turns.
                time:      (N,) [s], rising: each sample follows the one before. Without, samples
                           follow from home and never influence each other.
                tolerance: largest residual of a joint [rad or m].
        Raises: InputError: for times that do not rise, or a tolerance that is none.
        """
        joints = np.asarray(joints, dtype=float)
        _check(tolerance)
        if time is None:
            pose, reached = follow(self._steps, np.zeros((len(joints), 6)), joints)
            status = judge(reached, self._steps.step(pose, joints).residual, tolerance)
        else:
            time = np.asarray(time, dtype=float)
            if not (np.diff(time) > 0).all():
                at = int(np.argmin(np.diff(time) > 0))
                raise InputError(
                    f"times must rise: {time[at + 1]:g} s follows {time[at]:g} s (row {at + 2}). "
                    "Without times, rows stand alone"
                )
            pose, status = track(self._steps, joints, time, tolerance)
        at_pose = self._steps.step(pose, joints)
        found = status == PoseStatus.OK
        condition = np.full(len(joints), np.nan)
        condition[found] = np.linalg.cond(at_pose.A[found])
        nowhere = (status != PoseStatus.OK) & (status != PoseStatus.INCONSISTENT)
        residual = np.where(nowhere[:, None], np.nan, at_pose.residual)
        pose = np.where(found[:, None], principal(pose), np.nan)
        return ForwardSolution(pose, residual, condition, status)

    def modes(
        self, joints: np.ndarray, seed: int = 0, tolerance: float = TOLERANCE
    ) -> AssemblyModes:
        """Assembly modes of one sample, (n,), that a seeded search finds; it may miss some."""
        _check(tolerance)
        return search(self._mechanism, self._steps, np.asarray(joints, float), seed, tolerance)


def _check(tolerance: float) -> None:
    if not 0 <= tolerance < np.inf:
        raise InputError(f"tolerance: expected a finite number from 0 on, got {tolerance:g}")
