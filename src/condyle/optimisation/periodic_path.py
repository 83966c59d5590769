"""One smooth closed cycle through key poses."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..files.limits import sample_count
from ..motion.spline import Spline

KNOTS = 48  # beside the cycle; the ends' effect falls by 0.43 a knot, to 1e-17


def periodic(
    poses: np.ndarray, period: float, rate: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The periodic quintic spline through poses (K, m) at even times, the first at both ends.

    Returns: t (N,), values (N, m), time of each pose (K,).
    """
    count = round(sample_count(period, rate))
    if count < 2 * len(poses):
        raise InputError(f"rate: expected two samples a pose or more, got {count} for a period")
    k = np.arange(-KNOTS, len(poses) + KNOTS + 1)
    spline = Spline.through(k * period / len(poses), poses[k % len(poses)])
    t = np.linspace(0.0, period, count + 1)
    return t, spline(t), np.arange(len(poses)) * period / len(poses)
