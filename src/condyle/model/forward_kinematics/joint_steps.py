"""Gauss-Newton steps from a pose towards joint coordinates, on the surfaces of the contacts.

The freedoms are the independent coordinates, X' = M_J q'; n joints over-determine them. Joints that
turn count by the characteristic length, and so do angles of the pose: see `questions.pose`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...backends.numpy_kernel import NumpyKernel
from ...kinematics.chain import FAMILIES
from ...kinematics.constraints import indices
from ...kinematics.pose_finder import Conditions, NewtonSteps, least_squares
from ...kinematics.singularities import admitted_twists
from ...mechanism.home import characteristic_length, independent_coordinates
from ...mechanism.mechanism import Mechanism
from ...motion.followed_closure import MOTION
from ...questions import Question
from ...questions.file_numbers import numbers_of
from ...questions.numbers import specialised
from ...questions.structure import structure_of
from ..yielding import SETTLED, STEPS, LevelPoses, Place


class JointSteps(NewtonSteps):
    """Steps towards joint coordinates (N, n); NaN where a chain cannot reach the pose.

    twists: poses (N, 6) -> the joints' rates on [V; omega], (N, n, 6), and the wrenches of the
            contacts, (N, k, 6).
    release: poses -> how they leave the surfaces with phi, (N, 6, k), and J_theta, (N, n, 6).
    """

    twists: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    release: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]

    def placing(self, joints: np.ndarray) -> Place:
        """Poses nearest to joint coordinates, (N, n), where contacts yield."""

        def place(level: np.ndarray, pose: np.ndarray, rows: np.ndarray) -> LevelPoses:
            for _ in range(STEPS):
                at, (release, J) = self.conditions(pose), self.release(pose)
                A = at.slope * self._weight[:, None] * self.free_unit
                back = at.back - (release @ level[..., None])[..., 0]
                left = self._without_turns(joints[rows] - at.value) - (J @ back[..., None])[..., 0]
                dq = least_squares(A, (left * self._weight)[..., None])
                move = back + (at.basis @ (dq * self.free_unit[:, None]))[..., 0]
                pose = pose + move
                if not np.abs(move).max(initial=0.0) > SETTLED:
                    break
            # Along levels the pose goes off the surfaces, and joints are met again.
            met = least_squares(A, (J @ release) * self._weight[:, None])
            by_level = -release + at.basis @ (met * self.free_unit[:, None])
            still = np.zeros_like(pose)
            return LevelPoses(dict(zip(MOTION, (pose, still, still), strict=True)), by_level)

        return place

    def condition(self, pose: np.ndarray) -> np.ndarray:
        """Condition number, (N,), of the joints' rates on the twists that the contacts admit."""
        J, N = self.twists(pose)
        A = J * self._weight[:, None] * self._unit
        return np.linalg.cond(A @ admitted_twists(N * self._unit).transpose(0, 2, 1))


def joint_steps(mechanism: Mechanism) -> JointSteps:
    """The steps of a mechanism."""
    structure = structure_of(mechanism)
    numbers = numbers_of(structure, mechanism)
    question = Question.about(specialised(structure, numbers), "encoders")
    kernel = NumpyKernel(question.variants(), numbers)

    def at(pose: np.ndarray) -> Conditions:
        values = kernel.run({"pose": pose}).values
        # Sample after sample in memory: else numpy multiplies one sample by other code than many.
        J = np.ascontiguousarray(values["J_theta"].transpose(2, 1, 0))
        M_J = np.ascontiguousarray(np.moveaxis(values["M_J"], -1, 0))
        joint, back, off = (values[name].T for name in ("joint", "correction", "phi"))
        return Conditions(joint, J @ M_J, M_J, back, (J @ back[..., None])[..., 0], off)

    def twists(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = kernel.run({"pose": pose}).values
        return values["twist"].transpose(2, 1, 0), np.moveaxis(values["N"], -1, 0)

    def release(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = kernel.run({"pose": pose}).values
        return np.moveaxis(values["release"], -1, 0), values["J_theta"].transpose(2, 1, 0)

    turns = np.array([FAMILIES[chain.kind].joint_unit == "rad" for chain in mechanism.chains])
    free = np.array(indices(independent_coordinates(mechanism)))
    steps = JointSteps(at, characteristic_length(mechanism), turns, free, turning=True)
    steps.twists, steps.release = twists, release
    return steps
