"""What became of a row of joint coordinates."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class PoseStatus(IntEnum):
    """OK, or the reason why there is no pose.

    UNREACHABLE:  the continuation ends before it reaches the joint coordinates.
    LOST:         beyond a singularity the assembly mode is uncertain (with times).
    INCONSISTENT: the nearest pose leaves a residual beyond the tolerance.
    """

    OK = 0
    UNREACHABLE = 1
    LOST = 2
    INCONSISTENT = 3


def judge(reached: np.ndarray, residual: np.ndarray, tolerance: float) -> np.ndarray:
    """Statuses (N,) of poses that were reached or not, (N,), with residuals (N, n)."""
    with np.errstate(invalid="ignore"):
        fits = (np.abs(residual) <= tolerance).all(axis=1)
    missed = np.where(reached, PoseStatus.INCONSISTENT, PoseStatus.UNREACHABLE)
    return np.where(reached & fits, PoseStatus.OK, missed).astype(int)
