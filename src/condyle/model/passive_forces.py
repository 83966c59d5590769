"""Forces of ligaments at poses: what results show of the passive part of the balance."""

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
    """Ligaments at N samples: lengths [m] and forces [N], (N, L) each."""

    ligament_length: np.ndarray
    ligament_force: np.ndarray

    @staticmethod
    def of(mechanism: Mechanism, pose: np.ndarray, rate: np.ndarray) -> PassiveForces:
        """Args: pose, rate: X_EE and its rate, (N, 6)."""
        still = np.zeros_like(pose)
        given = {"pose": pose, "pose_rate": rate, "pose_acceleration": still}
        values = _kernel(mechanism).run(given).values
        names = PassiveForces.__dataclass_fields__
        return PassiveForces(*(np.moveaxis(values[name], -1, 0) for name in names))


@lru_cache(maxsize=8)
def _kernel(mechanism: Mechanism) -> NumpyKernel:
    structure = structure_of(mechanism)
    return NumpyKernel(
        Question.about(structure, "passive").variants(), numbers_of(structure, mechanism)
    )
