"""A motion to try a mechanism with, where none was measured: SYNTHETIC, from a formula."""

from __future__ import annotations

import numpy as np

from ..mechanism.home import characteristic_length, independent_coordinates
from ..mechanism.mechanism import Mechanism
from .path import Motion

SWAY = 0.03  # of the characteristic length, and in radians
SLOWEST, STEP = 0.4, 0.15  # of the first coordinate's sway, and from one to the next [Hz]


def trial_motion(
    mechanism: Mechanism,
    *,
    cutoff: float | str | None = None,
    rate: float | None = None,
    trim: float = 0.0,
) -> Motion:
    """Five seconds in which the independent coordinates sway about home, each at its own pace.

        q_i = a_i w(t) sin(2 pi f_i t),    f_i = 0.4, 0.55, 0.7, ... Hz

    with a_i = 3 % of the characteristic length or 0.03 rad, and w rising from 0 to 1 in the first
    second. Synthetic.

    Args: cutoff, rate, trim: as of `Motion.from_arrays`.
    """
    t = np.round(np.linspace(0, 5, 5001), 3)
    names = independent_coordinates(mechanism)
    length = SWAY * characteristic_length(mechanism)
    columns = {
        name: (length if name in "XYZ" else SWAY)
        * rise(t)
        * np.sin(2 * np.pi * (SLOWEST + STEP * i) * t)
        for i, name in enumerate(names)
    }
    source = "trial motion (synthetic)"
    return Motion.from_arrays(t, columns, cutoff=cutoff, rate=rate, trim=trim, source=source)


def rise(s: np.ndarray) -> np.ndarray:
    """From 0 at 0 to 1 at 1, with four smooth derivatives."""
    s = np.clip(s, 0, 1)
    return s**5 * (126 - 420 * s + 540 * s**2 - 315 * s**3 + 70 * s**4)
