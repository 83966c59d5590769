"""Eigen-screws of a compliance: wrenches under which a body moves along their own screw.

    C w = lambda Delta w,    w = (f, m),    Delta w = (m, f)

so that it turns by lambda f and moves by lambda m: about the axis of w, with its pitch
f . m / f . f. Axes, pitches and lambda are the same of every point that C is taken at. Patterson
and Lipkin, Structure of robot compliance, J. Mechanical Design 115 (1993).
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray
HELD = 1e-12  # of the largest compliance: what is held has rounding alone
SWAPPED = np.roll(np.eye(6), 3, axis=0)


def eigenscrews(compliance: Array, length: Array) -> tuple[Array, Array]:
    """lambda (N, 6) [rad/N], falling, and wrenches (N, 6, 6), one a row, with a unit force; NaN
    where contacts or chains hold, and where C is not known.

    Args: compliance: (N, 6, 6), translation first;  length: characteristic, (N,) or () [m].
    """
    count = len(compliance)
    unit = np.ones((count, 6))
    unit[:, 3:] = np.reshape(length, (-1, 1))
    found, wrenches = np.full((count, 6), np.nan), np.full((count, 6, 6), np.nan)
    good = np.isfinite(compliance).all(axis=(1, 2))
    C = (compliance * unit[:, :, None] * unit[:, None])[good]
    sizes, axes = np.linalg.eigh((C + C.transpose(0, 2, 1)) / 2)
    sizes = np.where(sizes > HELD * np.abs(sizes).max(axis=1, keepdims=True), sizes, 0.0)
    root = SWAPPED @ (axes * np.sqrt(sizes)[:, None])
    values, columns = np.linalg.eigh(root.transpose(0, 2, 1) @ SWAPPED @ root)
    largest = np.abs(values).max(axis=1, keepdims=True, initial=0.0)
    values = np.where(np.abs(values) > HELD * largest, values, np.nan)
    order = np.argsort(-values, axis=1)  # what is not known last
    values = np.take_along_axis(values, order, axis=1)
    columns = np.take_along_axis(columns, order[:, None], axis=2)
    rows = (root @ columns / values[:, None]).transpose(0, 2, 1) * unit[good][:, None]
    found[good] = values / unit[good, 5:]
    wrenches[good] = rows / np.linalg.norm(rows[..., :3], axis=2, keepdims=True)
    return found, wrenches
