"""Gauss-Newton steps from a pose towards joint coordinates, on the surfaces of the contacts.

The freedoms are the independent coordinates, X' = M_J q'; n joints over-determine them. Joints that
turn count by the characteristic length, and so do angles of the pose: see `questions.pose`.
"""

from __future__ import annotations

import numpy as np

from ...backends.numpy_kernel import NumpyKernel
from ...kinematics.chain import FAMILIES
from ...kinematics.constraints import indices
from ...mechanism.home import characteristic_length, independent_coordinates
from ...mechanism.mechanism import Mechanism
from ...questions import Question
from ...questions.numbers import Layout, specialised
from ...questions.structure import structure_of
from ..continuation import Conditions, Steps


def joint_steps(mechanism: Mechanism) -> Steps:
    """Steps towards joint coordinates (N, n); NaN where a chain cannot reach the pose."""
    structure = structure_of(mechanism)
    numbers = Layout.of(structure).numbers(mechanism)
    question = Question.about(specialised(structure, numbers), "encoders")
    kernel = NumpyKernel(question.variants(), numbers)

    def at(pose: np.ndarray) -> Conditions:
        values = kernel.run({"pose": pose}).values
        # Sample after sample in memory: else numpy multiplies one sample by other code than many.
        J = np.ascontiguousarray(values["J_theta"].transpose(2, 1, 0))
        M_J = np.ascontiguousarray(np.moveaxis(values["M_J"], -1, 0))
        joint, back, off = (values[name].T for name in ("joint", "correction", "phi"))
        return Conditions(joint, J @ M_J, M_J, back, (J @ back[..., None])[..., 0], off)

    turns = np.array([FAMILIES[chain.kind].joint_unit == "rad" for chain in mechanism.chains])
    free = np.array(indices(independent_coordinates(mechanism)))
    return Steps(at, characteristic_length(mechanism), turns, free, turning=True)
