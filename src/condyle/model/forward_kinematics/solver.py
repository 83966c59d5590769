"""Forward kinematics: from encoder readings, joint + zero, to the pose.

n joint coordinates over-determine a pose that the contacts leave 6 - k freedoms. The pose is the
one on the contacts whose joints are nearest in the least-squares sense, with angles multiplied by
the characteristic length, and of the assembly mode that leads there from home (`find`) or, with
times, from the row before (`track`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, brief
from ...kinematics.constraints import indices
from ...kinematics.pose_finder import NewtonStep, find
from ...mechanism.home import independent_coordinates
from ...mechanism.mechanism import Mechanism
from ...motion.arrays import as_samples
from ...questions.bound import ROUNDING, SAFETY
from ...status import Status
from ..arguments import POSE, Arguments, samples
from ..model_result import ModelResult
from ..yielding import CLOSED
from .assembly_modes import AssemblyModes, search
from .joint_steps import joint_steps
from .orientation import principal
from .pose_status import PoseStatus, judge
from .track import track

if TYPE_CHECKING:
    from ..inverse_dynamics import InverseDynamics

TOLERANCE = 1e-6  # of a joint [rad or m]
START = POSE._replace(name="start")


class ForwardKinematics:
    """Solves poses of one mechanism from readings of its encoders."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._steps = joint_steps(mechanism)
        independent = independent_coordinates(mechanism)
        self._joint = Arguments(mechanism).joint
        self._independent = indices(independent)

    @np.errstate(all="ignore")
    def solve(
        self, joint: Any, time: Any = None, tolerance: float = TOLERANCE, start: Any = None
    ) -> ModelResult:
        """As `Model.forward_kinematics`.

        Samples without times never influence each other.
        """
        _check(tolerance)
        given = np.zeros(6) if start is None else START.array(start)
        arguments = (self._joint, START)
        lead, (joints, first) = samples(arguments, (self._read(joint), given))
        count = max(len(joints), len(first)) if 0 not in lead else 0
        joints = np.broadcast_to(joints, (count, joints.shape[1]))
        first = np.broadcast_to(first, (count, 6))
        if time is None:
            pose, reached = find(self._steps, first, joints)
            status = judge(reached, self._steps.step(pose, joints).residual, tolerance)
        else:
            if len(lead) != 1 or start is not None:
                raise InputError("time: expected joint coordinates of shape (N, n), and no start")
            pose, status = track(self._steps, joints, _times(time, count), tolerance)
        at_pose = self._steps.step(pose, joints)
        ok = status == PoseStatus.OK
        condition = np.full(count, np.nan)
        condition[ok] = self._steps.condition(pose[ok])
        nowhere = (status != PoseStatus.OK) & (status != PoseStatus.INCONSISTENT)
        residual = np.where(nowhere[:, None], np.nan, at_pose.residual)
        pose = np.where(ok[:, None], principal(pose), np.nan)
        return ModelResult(
            pose=pose,
            q=pose[:, self._independent],
            residual=residual,
            condition=condition,
            bound=np.where(ok, self._bound(pose, at_pose), np.nan),
            status=status,
        ).shaped(lead)

    @np.errstate(all="ignore")
    def yielding(
        self,
        rigid: ModelResult,
        joint: Any,
        wrench: Any,
        at: Any,
        inverse: InverseDynamics,
        tolerance: float,
    ) -> ModelResult:
        """The same where contacts yield to the forces at rest, with these forces.

        Args: rigid: result of `solve` for the same readings;  inverse: what answers for forces.
        """
        _check(tolerance)
        arguments = (self._joint, POSE)
        given = self._read(joint), rigid.pose
        lead, ports = inverse.arguments.samples(arguments, given, wrench, at)
        count = math.prod(lead)
        ports = {name: np.broadcast_to(a, (count, a.shape[1])) for name, a in ports.items()}
        joints, pose = ports.pop("joint"), ports.pop("pose")
        answer = inverse.yielded(self._steps.placing(joints), pose, ports)
        values, yielded = answer.values, answer.values["pose"].T
        step, known = self._steps.step(yielded, joints), np.isfinite(yielded).all(axis=1)
        status = np.broadcast_to(rigid.status, lead).reshape(count).copy()
        own = judge(known, step.residual, tolerance)
        status = np.where(status == PoseStatus.OK, own, status)
        converged = status == PoseStatus.OK
        pose = np.where(converged[:, None], principal(yielded), np.nan)
        condition = np.full(count, np.nan)
        condition[converged] = self._steps.condition(pose[converged])
        settled = replace(step, size=np.full(count, CLOSED / self._steps.length))
        forces = {name: values[name].T for name in ("effort", "contact_force", "indentation")}
        lost = ~(converged & (answer.status == Status.ok))
        for value in forces.values():
            value[lost] = np.nan
        return ModelResult(
            pose=pose,
            q=pose[:, self._independent],
            residual=np.where(known[:, None], step.residual, np.nan),
            condition=condition,
            bound=np.where(converged, self._bound(pose, settled), np.nan),
            **forces,
            status=status,
        ).shaped(lead)

    def _read(self, reading: Any) -> np.ndarray:
        """Joint coordinates, zero at home, that encoders' readings stand for."""
        return self._joint.array(reading) - self._mechanism.zeros

    def _bound(self, pose: np.ndarray, step: NewtonStep) -> np.ndarray:
        """A bound of the pose's error, (N,), in characteristic lengths and radians.

        The step that would follow, and rounding of the joints and of the contacts, through A^+ and
        the contacts' M_J.
        """
        bound = np.full(len(pose), np.nan)
        good = np.flatnonzero(np.isfinite(step.A).all(axis=(1, 2)))
        A, M_J = step.A[good], self._steps.scaled_basis(pose[good])
        least = np.linalg.svd(A, compute_uv=False)[:, -1]
        rounding = ROUNDING * (1 + np.abs(A).sum(axis=2).max(axis=1)) / least
        grown = np.linalg.norm(M_J, axis=(1, 2))
        bound[good] = SAFETY * grown * rounding + 2 * step.size[good]
        return bound

    def modes(
        self, joints: np.ndarray, seed: int = 0, tolerance: float = TOLERANCE
    ) -> AssemblyModes:
        """Assembly modes of one sample, (n,), that a seeded search finds; it may miss some."""
        _check(tolerance)
        return search(self._mechanism, self._steps, self._read(joints), seed, tolerance)


def _check(tolerance: Any) -> None:
    if not isinstance(tolerance, int | float | np.number) or not 0 <= tolerance < np.inf:
        raise InputError(
            f"tolerance: expected a finite number of at least 0, got {brief(tolerance)}"
        )


def _times(given: Any, count: int) -> np.ndarray:
    time = as_samples(given, "time", "forward kinematics", count, "s")
    if not (np.diff(time) > 0).all():
        at = int(np.argmin(np.diff(time) > 0))
        raise InputError(
            "times must be strictly increasing: "
            f"{time.flat[at + 1]:g} s follows {time.flat[at]:g} s (row {at + 2}). "
            "Without times, rows stand alone"
        )
    return time
