"""What a kernel returns: plain arrays of samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PoseRates:
    """X_EE, X_EE', X_EE'' at N samples, (N, 6) each, and where the contacts could be met, (N,)."""

    pose: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    reached: np.ndarray


@dataclass(frozen=True)
class Torques:
    """Efforts at N samples; None where they were not asked for.

    torque:        (N, n) [N m or N].
    share:         (parts, N, n): what each part needs of it.
    contact_force: (N, k) [N], along the unit normals, on the platform.
    rate, acceleration: of the joints, (N, n).
    reached:       (N,), where every chain and contact can be.
    poses:         of the same samples.
    uncertain:     (N,), samples so near a singularity that `Posture` has to judge them.
    condition:     (N,), condition number of the dimensionless J_W M_J.
    """

    torque: np.ndarray
    share: np.ndarray | None
    contact_force: np.ndarray | None
    rate: np.ndarray | None
    acceleration: np.ndarray | None
    reached: np.ndarray
    poses: PoseRates | None
    uncertain: np.ndarray
    condition: np.ndarray | None = None
