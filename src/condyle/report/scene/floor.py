"""The floor below a mechanism: a grid whose step is a round length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LINES = 9.0  # about how many along the longer side
ROOM = 0.06  # round the mechanism and below it, over the diagonal of everything


@dataclass(frozen=True)
class Floor:
    """lines: ends in {S}, (L, 2, 3) [m], at multiples of `step` [m]."""

    lines: np.ndarray
    step: float


def round_below(value: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is no larger than a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-9)))


def floor_below(points: np.ndarray) -> Floor:
    """The floor below places (P, 3) [m] of which some may be NaN."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    room = ROOM * float(np.linalg.norm(high - low))
    step = round_below(float((high - low + 2 * room)[:2].max()) / LINES)
    first, last = np.floor((low - room) / step), np.ceil((high + room) / step)
    x, y = (step * np.arange(first[i], last[i] + 1) for i in (0, 1))
    z = low[2] - 0.5 * room
    along_y = [[(a, y[0], z), (a, y[-1], z)] for a in x]
    along_x = [[(x[0], b, z), (x[-1], b, z)] for b in y]
    return Floor(np.array(along_y + along_x), step)
