"""Minimum-norm torques in kernels: two methods for A^T tau = b without iteration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from operator import mul
from typing import NamedTuple

import casadi as ca


class Pivots(NamedTuple):
    """Pivots of an elimination, each over what it was before: squares of |q_k| / |a_k|.

    terms: of the method, square of the length of tau's terms over its own; at least 1.
    """

    smallest: ca.SX
    product: ca.SX
    terms: ca.SX | float = 1.0

    @staticmethod
    def of(*ratios: ca.SX) -> Pivots:
        return Pivots(reduce(ca.fmin, ratios), reduce(mul, ratios))

    def joined(self, other: Pivots) -> Pivots:
        return Pivots(ca.fmin(self.smallest, other.smallest), self.product * other.product)

    @property
    def square(self) -> ca.SX:
        """About the square of the least singular value of A with columns of length one.

        The product of all pivots is det^2, which is too small if several singular values are; the
        smallest pivot can be too large. So the mean of the two, in logarithms.
        """
        return ca.sqrt(self.smallest * self.product)


# Limits of the normal equations: minimum |q_k|^2 / |a_k|^2 in the elimination,
CONDITIONED = 1e-3
# and maximum length of the terms of tau over its own, counted without signs.
CANCELLATION = 50.0

TINY = 1e-300  # avoids 0 / 0 where nothing pulls

Lanes = list[ca.SX]  # one expression a family group
Total = Callable[[Sequence[ca.SX]], ca.SX]


def normal_equations(total: Total, A: Lanes, b: ca.SX) -> tuple[Lanes, ca.SX, Pivots]:
    """Minimum-norm solutions tau = A y with A^T A y = b.

    Fast, since all its sums run at once. Elimination leaves A^T tau - b of rounding times
    |a_i| sum_j |a_j| |y_j| in equation i, where a backward stable method leaves rounding times
    |A| |tau|; their quotient can be as large as the condition number of A with columns of one
    length, which is how normal equations come to square it. The quotient itself is known, from
    |tau|^2 = y . b, and where

        m sum_j |a_j|^2 y_j^2 <= CANCELLATION^2 y . b

    the residual is a few times fifty roundings of |A| |tau|, so under 1e-12 times the condition
    number of |b|. That is so wherever the condition number, with columns of one length, is under
    `CANCELLATION` / sqrt(m), at least 20; above it b decides.

    Args:    total: sums entries over all chains.
             A: (m,) a group, lane values.  b: (m, r).
    Returns: tau, (r,) a group as rows; 1, or -1 where `gram_schmidt` is needed: a pivot is below
             `CONDITIONED` times its column's square, or the bound above, summed over the
             right-hand sides, does not hold; the pivots.
    """
    m, G = b.shape[0], gram(total, A, A)
    lengths = ca.diag(G)
    y, excess, pivots = definite_solve(G, b, lengths)
    terms = m * ca.dot(lengths, ca.sum2(y * y))
    square = ca.sum2(ca.sum1(y * b))
    spare = CANCELLATION**2 * square - terms
    pivots = pivots._replace(terms=ca.fmax(1, terms / (ca.fabs(square) + TINY)))
    least = reduce(ca.fmin, excess)
    # Compared separately, since backends treat NaN differently in a minimum.
    return [a.T @ y for a in A], 2 * (least >= 0) * (spare >= 0) - 1, pivots


def gram(total: Total, A: Lanes, B: Lanes) -> ca.SX:
    """The sum of a b^T over all chains, (m, m), where it is symmetric."""
    m = A[0].numel()
    pairs = [(j, k) for j in range(m) for k in range(j, m)]
    found = total([ca.vertcat(*(a[j] * b[k] for j, k in pairs)) for a, b in zip(A, B, strict=True)])
    G = ca.SX(m, m)
    for at, (j, k) in enumerate(pairs):
        G[j, k] = G[k, j] = found[at]
    return G


def definite_solve(
    G: ca.SX, b: ca.SX, lengths: ca.SX, least: float = CONDITIONED
) -> tuple[ca.SX, list[ca.SX], Pivots]:
    """G^-1 b for a symmetric, positive definite G, eliminating two rows at a time.

    Half as many divisions as row by row, and divisions are the critical path. Only the upper
    triangle of G is used.

    Args:    lengths: (m,), the diagonal before elimination.
             least: minimum pivot over `lengths`.
    Returns: the solution, and the excess of the pivots over `least` times `lengths`, each times a
             positive number; the pivots over `lengths`.
    """
    m = G.shape[0]
    if m == 0:
        return ca.SX(0, b.shape[1]), [], Pivots.of(ca.SX(1))
    if m == 1:
        return b * (1 / G), [G - least * lengths], Pivots.of(G / lengths[0])
    u, v, w = G[0, 0], G[0, 1], G[1, 1]
    determinant = u * w - v * v
    scale = 1 / determinant
    u, v, w = u * scale, v * scale, w * scale
    inverse = ca.vertcat(ca.horzcat(w, -v), ca.horzcat(-v, u))
    excess = [
        G[0, 0] - least * lengths[0],
        determinant - least * (G[0, 0] * lengths[1]),
    ]
    B = G[:2, 2:]
    gain = inverse @ B
    below = G[2:, 2:] - B.T @ gain
    rest, more, pivots = definite_solve(below, b[2:, :] - gain.T @ b[:2, :], lengths[2:], least)
    own = Pivots.of(G[0, 0] / lengths[0], determinant / (G[0, 0] * lengths[1]))
    return ca.vertcat(inverse @ b[:2, :] - gain @ rest, rest), excess + more, own.joined(pivots)


def gram_schmidt(total: Total, A: Lanes, b: ca.SX) -> tuple[Lanes, ca.SX, Pivots]:
    """Minimum-norm solutions of A^T tau = b by modified Gram-Schmidt on the columns of A.

    A = Q R with unnormalised columns in Q and ones on the diagonal of R, so no square roots.
    R^T w = b, forwards, gives w = Q^T tau; then tau = Q c with

        c_k = (w_k - sum_{j > k} (q_k . q_j) c_j) / |q_k|^2,    k = m, ..., 1.

    The sum would be 0 if Q were orthogonal. Modified Gram-Schmidt leaves rounding times the
    condition number of it, and to project again in reverse order, as Bjoerck does for this
    problem, makes the method backward stable: A^T tau - b is rounding times |A| |tau|, however
    ill conditioned A is, and how long its columns are does not matter.

    Args:    total: sums entries over all chains.
             A: (m,) a group, lane values.  b: (m, r).
    Returns: tau, (r,) a group as rows; the smallest |q_k|^2 / |a_k|^2, which is small where A is
             ill conditioned; the pivots.
    """
    m = b.shape[0]
    columns = [[a[k] for a in A] for k in range(m)]
    lengths = total([a * a for a in A])
    w = [b[k, :] for k in range(m)]
    overlaps, inverses = [], []
    ratios = []
    for k in range(m):
        q = columns[k]
        # With earlier columns the loss of orthogonality, with later ones R.
        products = total(
            [ca.vertcat(*(x * column[g] for column in columns)) for g, x in enumerate(q)]
        )
        ratios.append(products[k] / lengths[k])
        overlaps.append(products[:k])
        inverses.append(1 / products[k])
        for j in range(k + 1, m):
            ratio = products[j] * inverses[k]
            columns[j] = [y - ratio * x for x, y in zip(q, columns[j], strict=True)]
            w[j] = w[j] - ratio * w[k]
    result = [ca.SX(1, b.shape[1]) for _ in A]
    for k in reversed(range(m)):
        c = w[k] * inverses[k]
        for j in range(k):
            w[j] = w[j] - overlaps[k][j] * c
        result = [r + x * c for r, x in zip(result, columns[k], strict=True)]
    pivots = Pivots.of(ca.SX(1), *ratios)
    return result, pivots.smallest, pivots
