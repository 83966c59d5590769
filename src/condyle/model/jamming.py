"""Forward dynamics on the robust path: every pattern of friction's signs, by LAPACK.

H w + F = D lambda with D = N - T sigma, six equations for w and lambda; a pattern sigma is
consistent where sigma lambda >= 0. Patterns that differ by a force of zero are one solution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

SINGULAR = 1e-12  # least over greatest singular value, rows and columns of one size
NOTHING = 1e-12  # relative change of the terms of the equations that may turn a force's sign


@dataclass(frozen=True)
class Balanced:
    """Solutions of N samples: the certain ones first, the others NaN, P = 2^f of them.

    w: (P, N, m);  force: lambda, (P, N, k);  count: of the solutions, (N,);  regular: (N,).
    """

    w: np.ndarray
    force: np.ndarray
    count: np.ndarray
    regular: np.ndarray


def balanced(system: Mapping[str, np.ndarray], frictional: Sequence[int]) -> Balanced:
    """Solve the equations of N samples for every pattern.

    A sign is in doubt where a change of every term of the equations by `NOTHING` may turn it. Where
    the determinants of all patterns have one sign there is one solution, and no doubt matters.

    Args: system: results of the question `forward_system`, samples first.
          rubbing: contacts with friction, by number.
    """
    H, F = system["H"], system["F"]
    N, T = (system[name].transpose(0, 2, 1) for name in ("normal", "friction"))
    frictional, (count, _, m) = list(frictional), H.shape
    patterns = np.array(list(product((1.0, -1.0), repeat=len(frictional))))
    shape = len(patterns), count
    x, good, sign = np.empty((*shape, 6)), np.empty(shape, dtype=bool), np.empty(shape)
    doubt, sigma = np.empty((*shape, len(frictional))), np.zeros(N.shape[2])
    for p, signs in enumerate(patterns):
        sigma[frictional] = signs
        A = np.concatenate([H, T * sigma - N], axis=2)
        inverse, good[p], sign[p] = _inverted(A)
        x[p] = _applied(inverse, A, -F)
        terms = system["size"] + np.abs(F) + _times(np.abs(A), np.abs(x[p]))
        doubt[p] = NOTHING * _times(np.abs(inverse), terms)[:, m:][:, frictional]
    pushed = patterns[:, None] * x[..., m:][..., frictional]  # sigma lambda, (P, N, f)
    unique = good.all(axis=0) & (sign == sign[0]).all(axis=0)
    least = pushed.min(axis=2, initial=np.inf)
    held = good & ((pushed >= -doubt).all(axis=2) | (unique & (least == least.max(axis=0))))
    order = np.argsort(np.where(held, -least, np.inf), axis=0, kind="stable")
    rows = np.arange(count)
    held, zero = held[order, rows], (np.abs(pushed) <= doubt)[order, rows]
    ranked, x = patterns[order], x[order, rows]
    for p in range(1, len(patterns)):
        alike = (ranked[p] == ranked[:p]) | (zero[p] & zero[:p])
        held[p] &= ~(held[:p] & (alike.all(axis=2) | unique)).any(axis=0)
    first = np.argsort(~held, axis=0, kind="stable")
    x = np.where(held[first, rows][..., None], x[first, rows], np.nan)
    return Balanced(x[..., :m], x[..., m:], held.sum(axis=0), np.any(good, axis=0))


def solved(A: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A^-1 right, (N, s), and where A is regular."""
    inverse, regular, _ = _inverted(A)
    return _applied(inverse, A, right), regular


def _times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    found: np.ndarray = (A @ x[..., None])[..., 0]
    return found


def _applied(inverse: np.ndarray, A: np.ndarray, right: np.ndarray) -> np.ndarray:
    """inverse right, and one step that refines it."""
    x = _times(inverse, right)
    return x + _times(inverse, right - _times(A, x))


def _inverted(A: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A^-1, (N, s, s), NaN where it is singular; where it is regular; the sign of det A, (N,).

    Rows and columns are first made of one size.
    """
    inverse, sign = np.full(A.shape, np.nan), np.zeros(len(A))
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
    with np.errstate(all="ignore"):
        found = (Vt.transpose(0, 2, 1) / sigma[:, None]) @ U.transpose(0, 2, 1)
        found = found / rows.transpose(0, 2, 1) / columns.transpose(0, 2, 1)
    found[~sure] = np.nan
    inverse[regular], sign[regular] = found, np.linalg.det(U) * np.linalg.det(Vt)
    regular[regular] = sure
    return inverse, regular, np.sign(sign)
