"""Forces of ligaments and gaps of walls at poses: what results show of the passive part."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..backends.numpy_kernel import NumpyKernel
from ..mechanism.mechanism import Mechanism
from ..questions import Question
from ..questions.file_numbers import numbers_of
from ..questions.structure import structure_of


@dataclass(frozen=True)
class PassiveForces:
    """Lengths [m] and forces [N] of ligaments, (N, L); gaps of walls [m], (N, W); at N samples."""

    ligament_length: np.ndarray
    ligament_force: np.ndarray
    wall_gap: np.ndarray

    @staticmethod
    def of(mechanism: Mechanism, pose: np.ndarray, rate: np.ndarray) -> PassiveForces:
        """Args: pose, rate: X_EE and its rate, (N, 6)."""
        still = np.zeros_like(pose)
        given = {"pose": pose, "pose_rate": rate, "pose_acceleration": still}
        values = _kernel(mechanism).run(given).values
        none = np.zeros((0, len(pose)))
        names = PassiveForces.__dataclass_fields__
        return PassiveForces(*(np.moveaxis(values.get(name, none), -1, 0) for name in names))


@lru_cache(maxsize=8)
def _kernel(mechanism: Mechanism) -> NumpyKernel:
    structure = structure_of(mechanism)
    return NumpyKernel(
        Question.about(structure, "passive").variants(), numbers_of(structure, mechanism)
    )
