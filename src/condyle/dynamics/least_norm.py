"""Torques of least norm in kernels: two ways to solve A^T tau = b without iteration."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

# |q_k|^2 / |a_k|^2 below which the normal equations lose too many digits: they square the
# condition number, and their error stays under about rounding / CONDITIONED.
CONDITIONED = 1e-3

Lanes = list[ca.SX]  # one expression a family group
Total = Callable[[Sequence[ca.SX]], ca.SX]


def normal_equations(total: Total, A: Lanes, b: ca.SX) -> tuple[Lanes, ca.SX]:
    """Least-norm solutions tau = A (A^T A)^-1 b.

    Quick, since all its sums run at once, and good to rounding times the square of the condition
    number; where the quality it returns is negative, `gram_schmidt` has to do the work.

    Args:    total: sums entries over all chains.
             A: (m,) a group, lane values.  b: (m, r).
    Returns: tau, (r,) a group as rows; 1, or -1 where columns of A are too nearly dependent: a
             pivot is below `CONDITIONED` times its column's square.
    """
    m = b.shape[0]
    pairs = [(j, k) for j in range(m) for k in range(j, m)]
    products = total([ca.vertcat(*(a[j] * a[k] for j, k in pairs)) for a in A])
    G = ca.SX(m, m)
    for (j, k), product in zip(pairs, ca.vertsplit(products), strict=True):
        G[j, k] = G[k, j] = product
    y, excess = _definite_solve(G, b, ca.diag(G))
    least = excess[0]
    for value in excess[1:]:
        least = ca.fmin(least, value)
    return [a.T @ y for a in A], 2 * (least >= 0) - 1


def _definite_solve(G: ca.SX, b: ca.SX, lengths: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
    """G^-1 b for a symmetric, positive definite G, eliminating two rows at a time.

    Half as many divisions as row by row, and they are what the rest waits for.

    Args:    lengths: (m,), what the pivots were before anything was eliminated.
    Returns: the solution, and how much the pivots exceed `CONDITIONED` times `lengths`, each
             times a positive number.
    """
    m = G.shape[0]
    if m == 0:
        return ca.SX(0, b.shape[1]), []
    if m == 1:
        return b * (1 / G), [G - CONDITIONED * lengths]
    u, v, w = G[0, 0], G[0, 1], G[1, 1]
    determinant = u * w - v * v
    scale = 1 / determinant
    u, v, w = u * scale, v * scale, w * scale
    inverse = ca.vertcat(ca.horzcat(w, -v), ca.horzcat(-v, u))
    excess = [
        G[0, 0] - CONDITIONED * lengths[0],
        determinant - CONDITIONED * (G[0, 0] * lengths[1]),
    ]
    B = G[:2, 2:]
    gain = inverse @ B
    rest, more = _definite_solve(G[2:, 2:] - B.T @ gain, b[2:, :] - gain.T @ b[:2, :], lengths[2:])
    return ca.vertcat(inverse @ b[:2, :] - gain @ rest, rest), excess + more


def gram_schmidt(total: Total, A: Lanes, b: ca.SX) -> tuple[Lanes, ca.SX]:
    """Least-norm solutions of A^T tau = b by modified Gram-Schmidt on the columns of A.

    A = Q R with orthogonal, unnormalised columns, so that tau = Q (Q^T Q)^-1 R^-T b: no square
    roots, and an error of rounding times the condition number, not its square.

    Args:    total: sums entries over all chains.
             A: (m,) a group, lane values.  b: (m, r).
    Returns: tau, (r,) a group as rows; the least |q_k|^2 / |a_k|^2, which is small where A is
             ill conditioned.
    """
    m = b.shape[0]
    columns = [[a[k] for a in A] for k in range(m)]
    lengths = total([a * a for a in A])
    z = [b[k, :] for k in range(m)]
    result = [ca.SX(1, b.shape[1]) for _ in A]
    quality = ca.SX(1.0)
    for k in range(m):
        q = columns[k]
        products = total(
            [ca.vertcat(*(x * columns[j][g] for j in range(k, m))) for g, x in enumerate(q)]
        )
        quality = ca.fmin(quality, products[0] / lengths[k])
        inverse = 1 / products[0]
        for j in range(k + 1, m):
            ratio = products[j - k] * inverse
            columns[j] = [y - ratio * x for x, y in zip(q, columns[j], strict=True)]
            z[j] = z[j] - ratio * z[k]
        weight = z[k] * inverse
        result = [r + x * weight for r, x in zip(result, q, strict=True)]
    return result, quality
