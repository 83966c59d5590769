"""From pose to pose, at rest in each, with bounded speed, acceleration and jerk."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..files.limits import sample_count


def point_to_point(
    poses: np.ndarray, bounds: np.ndarray, rate: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Straight lines between poses (K, m), each the fastest within bounds (3, m) of every column.

    The whole is slowed to a whole number of samples at `rate`.
    Returns: t (N,), values (N, m), time of each pose (K,).
    """
    steps = []
    for k, move in enumerate(np.diff(poses, axis=0)):
        size = np.abs(move)
        if not size.any():
            raise InputError(f"pose {k + 2}: is the one before it; leave it out")
        with np.errstate(divide="ignore"):
            steps.append(_double_s(*(bounds / size).min(axis=1)))
    ends = np.array([0.0, *np.cumsum([sum(lengths) for lengths, _ in steps])])
    count = int(np.ceil(sample_count(ends[-1], rate) - 1e-9))
    slower = count / rate / ends[-1]
    t = np.arange(count + 1) / rate
    values = poses[0] + sum(
        _progress(t / slower - start, *step)[:, None] * move
        for start, step, move in zip(ends, steps, np.diff(poses, axis=0), strict=False)
    )
    return t, values, ends * slower


def _double_s(v: float, a: float, j: float) -> tuple[np.ndarray, np.ndarray]:
    """Lengths and jerks of the seven pieces of the fastest way from 0 to 1, at rest in both."""
    a = min(a, np.sqrt(v * j), np.cbrt(j * j / 2))  # that v and the distance allow
    v = min(v, (np.sqrt((a / j) ** 2 + 4 / a) - a / j) * a / 2)  # that the distance allows
    bent, straight, even = a / j, max(v / a - a / j, 0.0), max(1 / v - v / a - a / j, 0.0)
    lengths = np.array([bent, straight, bent, even, bent, straight, bent])
    return lengths, j * np.array([1, 0, -1, 0, -1, 0, 1])


def _progress(t: np.ndarray, lengths: np.ndarray, jerks: np.ndarray) -> np.ndarray:
    """s of times (N,): 0 before the start, 1 after the end."""
    s = np.where(t > 0, 1.0, 0.0)
    start, state = 0.0, np.zeros(3)
    for length, jerk in zip(lengths, jerks, strict=True):
        d = t - start
        inside = (d >= 0) & (d < length)
        x, v, a = state
        s[inside] = (x + d * (v + d * (a / 2 + d * jerk / 6)))[inside]
        state = np.array(
            [
                x + length * (v + length * (a / 2 + length * jerk / 6)),
                v + length * (a + length * jerk / 2),
                a + length * jerk,
            ]
        )
        start += length
    return s
