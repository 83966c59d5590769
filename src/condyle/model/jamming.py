"""Forward dynamics on the robust path: every pattern of friction's signs, by LAPACK.

H w + F = D lambda with D = N - T sigma, six equations for w and lambda; a pattern sigma is
consistent where sigma lambda >= 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

SINGULAR = 1e-12  # least over greatest singular value, rows and columns of one size
NOTHING = 1e-12  # of the largest force: a contact force that has no sign
SAME = 1e-9  # how far apart, over their size, solutions are one


@dataclass(frozen=True)
class Balanced:
    """w, (N, m), and lambda, (N, k); where equations are regular, and where one pattern serves."""

    w: np.ndarray
    force: np.ndarray
    regular: np.ndarray
    single: np.ndarray


def balanced(system: Mapping[str, np.ndarray], rubbing: Sequence[int]) -> Balanced:
    """Solve the equations of N samples.

    Args: system: results of the question `forward_system`, samples first.
          rubbing: contacts with friction, by number.
    """
    H, F = system["H"], system["F"]
    N, T = (system[name].transpose(0, 2, 1) for name in ("normal", "friction"))
    count, _, m = H.shape
    x = np.full((count, 6), np.nan)
    regular, found, several = np.zeros((3, count), dtype=bool)
    for signs in product((1.0, -1.0), repeat=len(rubbing)):
        sigma = np.zeros(N.shape[2])
        sigma[list(rubbing)] = signs
        one, good = solved(np.concatenate([H, T * sigma - N], axis=2), -F)
        regular |= good
        force = one[:, m:]
        tiny = NOTHING * np.abs(force).max(axis=1, initial=0.0, keepdims=True)
        kept = good & (sigma * force >= -tiny).all(axis=1)
        size = np.maximum(np.abs(x), np.abs(one)).max(axis=1)
        other = np.abs(x - one).max(axis=1) > SAME * size
        several |= kept & found & other
        x[kept & ~found] = one[kept & ~found]
        found |= kept
    return Balanced(x[:, :m], x[:, m:], regular, found & ~several)


def solved(A: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A^-1 right, (N, s), and where A is regular; rows and columns are first made of one size."""
    x = np.full(right.shape, np.nan)
    regular = np.isfinite(A).all(axis=(1, 2))
    A = A[regular]
    columns = np.abs(A).max(axis=1, keepdims=True)
    A = A / columns
    rows = np.abs(A).max(axis=2, keepdims=True)
    A = A / rows
    sure = np.isfinite(A).all(axis=(1, 2))
    A[~sure] = 0.0
    U, sigma, Vt = np.linalg.svd(A)
    sure &= sigma[:, -1] >= SINGULAR * sigma[:, 0]
    y = U.transpose(0, 2, 1) @ (right[regular][..., None] / rows)
    y = Vt.transpose(0, 2, 1) @ (y / sigma[..., None])
    x[regular] = np.where(sure[:, None], y[..., 0] / columns[:, 0], np.nan)
    regular[regular] = sure
    return x, regular
