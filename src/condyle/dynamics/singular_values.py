"""Singular values of a matrix of lanes, in a fixed number of operations.

A becomes a bidiagonal B by Householder matrices from the right and Gram-Schmidt from the left
(Barlow, Bosner and Drmac), which costs rounding times the largest singular value and no more. The
tridiagonal B^T B gives up its eigenvalues one by one to steps of QL without square roots (Pal,
Walker and Kahan), a fixed number each. The smallest follows from the determinant instead, which
keeps all digits that B has of it.
"""

from __future__ import annotations

from functools import reduce
from operator import mul

import casadi as ca

from .least_norm import Lanes, Total

STEPS = {3: 4, 4: 5, 5: 5, 6: 5}  # remaining rows -> QL steps for one eigenvalue
LEFT = 1e-15  # error of an eigenvalue over the trace
SPREAD = 1e-6  # minimum square of the second smallest singular value over the sum of squares
FLOOR = 1e-60  # minimum square of a pivot
TINY = 1e-300  # added to divisors that may be zero


def singular_values(total: Total, A: Lanes) -> tuple[ca.SX, ca.SX]:
    """Singular values of A, to 1e-13 of the largest; the smallest to rounding of the largest.

    Args:    total: sums entries over all chains.
             A: (m,) a group, lane values, 1 <= m <= 6.
    Returns: sigma, (m,), falling; 1, or -1 where they are not reliable: the steps were too few,
             the second smallest is under a thousandth of the largest, or A is not finite.
    """
    q, e = _bidiagonal(total, A)
    trace = ca.sum1(ca.vertcat(*q, *e))
    good = trace <= 1 / TINY
    if len(q) == 1:
        return ca.sqrt(trace), 2 * good - 1
    scale = 1 / (trace + TINY)
    q, e = [x * scale for x in q], [x * scale for x in e]
    # From the last row on, where B tends to be small: QL finds the smallest values first.
    d = [*(x + y for x, y in zip(q[:0:-1], e[::-1], strict=True)), q[0]]
    s = [x * y for x, y in zip(q[-2::-1], e[::-1], strict=True)]
    converged: list[ca.SX] = []
    while len(d) > 2:
        for _ in range(STEPS[len(d)]):
            d, s = _step(d, s)
        # s[0] moves an eigenvalue by less than its root, and by s[0] over the gap.
        good = good * (s[0] <= ca.fmax(LEFT**2, LEFT * ca.fabs(d[0] - d[1])))
        converged.append(d[0])
        d, s = d[1:], s[1:]
    values = _pair(d[0], d[1], s[0])
    for value in converged:
        values = _inserted(values, value)
    if converged:
        good = good * (values[-2] >= SPREAD)
    values[-1] = reduce(mul, q) / (reduce(mul, values[:-1]) + TINY)
    return ca.sqrt(ca.vertcat(*values) * trace), 2 * good - 1


def _bidiagonal(total: Total, A: Lanes) -> tuple[list[ca.SX], list[ca.SX]]:
    """Squares of B's diagonal, (m,), and of its superdiagonal, (m - 1,)."""
    lanes = [ca.vertsplit(a) for a in A]  # a group: its remaining columns
    q, e = [], []
    while lanes[0]:
        square, *x = ca.vertsplit(total([ca.vertcat(*(row[0] * y for y in row)) for row in lanes]))
        inverse = 1 / (square + TINY)
        q.append(square)
        if len(x) > 1:
            # I - w v^T takes x to -size in its first entry, and the columns with it.
            rest = ca.sumsqr(ca.vertcat(*x))
            size = ca.copysign(ca.sqrt(rest), x[0])
            w = [x[0] + size, *x[1:]]
            inverse_half = 1 / (rest + size * x[0] + TINY)
            v = [y * inverse_half for y in w]
            lanes = [[row[0], *_reflected(row[1:], w, v)] for row in lanes]
            e.append(rest * inverse)
            x = [-size]
        elif x:
            e.append(x[0] * x[0] * inverse)
        lanes = [_projected(row, x[0] * inverse) if x else [] for row in lanes]
    return q, e


def _reflected(row: list[ca.SX], w: list[ca.SX], v: list[ca.SX]) -> list[ca.SX]:
    """row (I - w v^T)."""
    along = row[0] * w[0]
    for x, y in zip(row[1:], w[1:], strict=True):
        along = along + x * y
    return [x - along * y for x, y in zip(row, v, strict=True)]


def _projected(row: list[ca.SX], ratio: ca.SX) -> list[ca.SX]:
    """The columns after the first, the next one orthogonal to it."""
    return [row[1] - ratio * row[0], *row[2:]]


def _step(d: list[ca.SX], s: list[ca.SX]) -> tuple[list[ca.SX], list[ca.SX]]:
    """A step of QL with Wilkinson's shift, towards s[0] = 0.

    Args: d: diagonal of a tridiagonal matrix, (m,).  s: squares beside it, (m - 1,).
    """
    d, s = list(d), list(s)
    half = (d[1] - d[0]) / 2
    root = ca.sqrt(half * half + s[0]) + TINY
    shift = d[0] - s[0] / (half + ca.copysign(root, half))
    cos2, sin2 = ca.SX(1), ca.SX(0)
    pivot = d[-1] - shift
    p = ca.fmax(pivot * pivot, FLOOR)  # pivot^2 / cos2
    for i in reversed(range(len(s))):
        r = p + s[i]
        if i < len(s) - 1:
            s[i + 1] = sin2 * r
        inverse = 1 / (r * p)  # one division for both
        cos2, sin2 = p * p * inverse, s[i] * p * inverse
        before = pivot
        pivot = cos2 * (d[i] - shift) - sin2 * before
        d[i + 1] = before + (d[i] - pivot)
        p = ca.fmax(pivot * pivot, FLOOR) * (r * r * inverse)
    s[0] = sin2 * p
    d[0] = shift + pivot
    return d, s


def _pair(a: ca.SX, b: ca.SX, s: ca.SX) -> list[ca.SX]:
    """Eigenvalues, falling, of a matrix with diagonal a, b and squares s beside it."""
    half = (a - b) / 2
    mean, root = (a + b) / 2, ca.sqrt(half * half + s)
    return [mean + root, mean - root]


def _inserted(values: list[ca.SX], value: ca.SX) -> list[ca.SX]:
    """Falling values with one more."""
    result = []
    for other in values:
        result.append(ca.fmax(other, value))
        value = ca.fmin(other, value)
    return [*result, value]
