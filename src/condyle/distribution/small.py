"""Sums and symmetric systems of up to six unknowns, one a sample, samples side by side."""

from __future__ import annotations

import numpy as np

FLAT = 1e-13  # a pivot below this part of its full size stands for a direction without curvature


def pick(a: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Some samples, by number or mask, side by side as before: an index would turn them around."""
    return np.take(a, rows.nonzero()[0] if rows.dtype == bool else rows, axis=-1)


def total(terms: np.ndarray, axis: int) -> np.ndarray:
    """Sum over an axis that is not the last, in the same order however many samples there are."""
    if terms.shape[-1] != 1:
        return terms.sum(axis=axis)
    # A single sample would be summed in pairs; two are not.
    return np.repeat(terms, 2, axis=-1).sum(axis=axis)[..., :1]


def gram(G: np.ndarray, weight: np.ndarray, size: int) -> list[list[np.ndarray]]:
    """Lower triangle of G diag(weight) G^T, (R,) each, of the first `size` rows of G, (6, n, R)."""
    rows = []
    for i in range(size):
        weighted = G[i] * weight
        rows.append([total(weighted * G[j], 0) for j in range(i + 1)])
    return rows


def solve(
    M: list[list[np.ndarray]], right: np.ndarray, full: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """M^-1 right by L D L^T without pivoting, which a positive definite M does not need.

    Args:    M: lower triangle, positive semidefinite; overwritten.   right: (size, R).
             full: what diagonals of M are of the size of, (size, R).
    Returns: the solution, (size, R), with the curvature `full` put where M has none; the least
             pivot as part of `full`, (R,).
    """
    size = len(M)
    quality = np.ones(right.shape[1])
    x = list(right)
    inverse = []
    for j in range(size):
        whole = np.where(full[j] > 0, full[j], 1.0)
        quality = np.minimum(quality, M[j][j] / whole)
        inverse.append(1.0 / np.where(M[j][j] > FLAT * whole, M[j][j], whole))
        column = [M[i][j] for i in range(j + 1, size)]
        for i in range(j + 1, size):
            factor = M[i][j] * inverse[j]
            for l in range(j + 1, i + 1):
                M[i][l] = M[i][l] - factor * column[l - j - 1]
            x[i] = x[i] - factor * x[j]
            M[i][j] = factor
    for j in reversed(range(size)):
        x[j] = x[j] * inverse[j]
        for i in range(j + 1, size):
            x[j] = x[j] - M[i][j] * x[i]
    return np.array(x).reshape(right.shape), quality
