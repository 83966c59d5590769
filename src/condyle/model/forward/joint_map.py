"""Joint coordinates as a function of the pose: all that forward kinematics asks of a mechanism."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...backends.numpy_kernel import NumpyKernel
from ...mechanism.mechanism import Mechanism
from ...questions import Question
from ...questions.numbers import Layout, specialised
from ...questions.structure import structure_of


@dataclass(frozen=True)
class JointsAt:
    """What joints and contacts say of N poses.

    joint:      (N, n) [rad or m], zero at home.
    J_theta:    (N, n, 6), on X_EE'.
    M_J:        (N, 6, m): X_EE' = M_J q'.
    correction: (N, 6): moves the dependent coordinates back onto the surfaces.
    phi:        (N, k) [m], how far the contact points are off them.
    """

    joint: np.ndarray
    J_theta: np.ndarray
    M_J: np.ndarray
    correction: np.ndarray
    phi: np.ndarray


JointMap = Callable[[np.ndarray], JointsAt]  # of poses X_EE, (N, 6)


def joint_map(mechanism: Mechanism) -> JointMap:
    """The map of one mechanism; NaN where a chain cannot reach the pose."""
    structure = structure_of(mechanism)
    numbers = Layout.of(structure).numbers(mechanism)
    question = Question.about(specialised(structure, numbers), "encoders")
    kernel = NumpyKernel(question.variants(), numbers)

    def at(pose: np.ndarray) -> JointsAt:
        values = kernel.run({"pose": pose}).values
        # Sample after sample in memory: else numpy multiplies one sample by other code than many.
        J_theta = np.ascontiguousarray(values["J_theta"].transpose(2, 1, 0))
        M_J = np.ascontiguousarray(np.moveaxis(values["M_J"], -1, 0))
        joint, correction, phi = (values[name].T for name in ("joint", "correction", "phi"))
        return JointsAt(joint, J_theta, M_J, correction, phi)

    return at
