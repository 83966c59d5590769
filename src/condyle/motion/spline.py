"""Interpolating splines, by numpy alone: `scipy.interpolate` takes longer to import than a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BLOCK = 32  # rows that are eliminated at once, at least twice the width of the band


@dataclass(frozen=True, eq=False)
class Spline:
    """s(t) = sum_j c_j B_j(t), B-splines of a degree.

    knots: (M + degree + 1,), never falling.  coefficients: (M, ...).
    """

    knots: np.ndarray
    coefficients: np.ndarray
    degree: int

    @classmethod
    def through(cls, t: np.ndarray, values: np.ndarray, degree: int = 5) -> Spline:
        """The spline of an odd degree through samples, "not a knot" at the ends.

        Args:   t: (N,), rising, N > degree.  values: (N, ...), finite.
        Returns: NaN coefficients where times lie too close together for numbers.
        """
        ends = np.ones(degree + 1)
        inner = t[(degree + 1) // 2 : len(t) - (degree + 1) // 2]
        knots = np.concatenate([t[0] * ends, inner, t[-1] * ends])
        with np.errstate(all="ignore"):
            first, rows = basis(knots, t, degree, 0)
            flat = _banded_solve(first, rows, values.reshape(len(t), -1))
        coefficients = flat.reshape(values.shape)
        return cls(knots, coefficients, degree)

    def __call__(self, t: np.ndarray, nu: int = 0) -> np.ndarray:
        """The derivative of order `nu` at times (K,); beyond the ends the last piece goes on."""
        first, rows = basis(self.knots, t, self.degree, nu)
        values: np.ndarray = np.zeros((len(t), *self.coefficients.shape[1:]))
        with np.errstate(all="ignore"):  # of times too close together
            for j in range(self.degree + 1):
                values += (rows[:, j] * self.coefficients[first + j].T).T
        return values


def basis(knots: np.ndarray, t: np.ndarray, degree: int, nu: int) -> tuple[np.ndarray, np.ndarray]:
    """The B-splines that are not zero at times (K,), or their derivatives of order `nu`.

    By the recurrence of Cox and de Boor; its last `nu` steps are those of derivatives.
    Returns: index of the first of them, (K,); values (K, degree + 1).
    """
    last = len(knots) - degree - 2
    i = np.clip(np.searchsorted(knots, t, side="right") - 1, degree, last)
    rows = np.ones((len(t), 1))
    for d in range(1, degree + 1):
        below, rows = rows, np.zeros((len(t), d + 1))
        for r in range(d):
            left, right = knots[i - d + 1 + r], knots[i + 1 + r]
            share = below[:, r] / (right - left)
            rows[:, r] += (right - t) * share if d <= degree - nu else -d * share
            rows[:, r + 1] += (t - left) * share if d <= degree - nu else d * share
    return i - degree, rows


def _banded_solve(first: np.ndarray, rows: np.ndarray, values: np.ndarray) -> np.ndarray:
    """x of A x = values, A with `rows` (N, w) from column `first` (N,) on, block by block.

    Matrices of collocation are totally positive, so that elimination without pivots is stable.
    """
    (count, width), size = rows.shape, BLOCK
    blocks = -(-count // size)
    padded = blocks * size
    band = np.zeros((blocks, size, 3 * size))  # what a block of rows has in it, before and after
    row = np.arange(count)
    column = (first - (row // size - 1) * size)[:, None] + np.arange(width)
    inside = (column >= 0) & (column < 3 * size)
    at = np.broadcast_to(row[:, None], column.shape)[inside]
    band[at // size, at % size, column[inside]] = rows[inside]
    for extra in range(count, padded):
        band[-1, extra % size, size + extra % size] = 1.0
    right = np.zeros((blocks, size, values.shape[1]))
    right.reshape(padded, -1)[:count] = values
    low, middle, high = (band[:, :, k * size : (k + 1) * size] for k in range(3))
    for b in range(blocks):
        if b:
            middle[b] -= low[b] @ high[b - 1]
            right[b] -= low[b] @ right[b - 1]
        solved = np.linalg.solve(middle[b], np.hstack([high[b], right[b]]))
        high[b], right[b] = solved[:, :size], solved[:, size:]
    for b in reversed(range(blocks - 1)):
        right[b] -= high[b] @ right[b + 1]
    return right.reshape(padded, -1)[:count]
