"""Contacts eliminated: the same problem in its smallest form.

One orthogonal transformation (Householder) a sample turns the six equations into

    A e = b,    lambda = c - B e,

m = 6 - k equations for the efforts e, and the contact forces that follow from them. Numbers of
samples lie side by side, sample last: every step is then a few operations on long rows, and no
sample can influence another.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from .problem import Problem
from .small import pick, total

DEPENDENT = 1e-11  # sine of an angle to other columns below which a contact adds nothing new


@dataclass(frozen=True)
class Reduced:
    """R samples: least f(x) + W |lambda|^2 / 2 for G x + (0, lambda) = right, within bounds.

    G:         rows A, then rows B, (6, n, R); columns times `scale`, so that x = effort / scale.
    right:     b, then c, (6, R).
    low, high: of x, (n, R).
    contact_low, contact_high: of lambda, (k, R).
    weight:    W.
    scale:     (n,).
    regular:   whether the contact forces are determined, (R,).
    """

    G: np.ndarray
    right: np.ndarray
    low: np.ndarray
    high: np.ndarray
    contact_low: np.ndarray
    contact_high: np.ndarray
    weight: float
    scale: np.ndarray
    regular: np.ndarray

    @cached_property
    def size(self) -> tuple[np.ndarray, np.ndarray]:
        """Greatest |G| of every row, and |right|, (6, R) each: what rounding is relative to."""
        return np.abs(self.G).max(axis=1, initial=0.0), np.abs(self.right)

    @property
    def k(self) -> int:
        return len(self.contact_low)

    @property
    def m(self) -> int:
        return 6 - self.k

    @property
    def n(self) -> int:
        return self.G.shape[1]

    @property
    def count(self) -> int:
        return self.G.shape[2]

    def take(self, rows: np.ndarray) -> Reduced:
        """Some of the samples."""
        names = ("G", "right", "low", "high", "contact_low", "contact_high", "regular")
        picked: dict[str, Any] = {name: pick(getattr(self, name), rows) for name in names}
        part = replace(self, **picked)
        if "size" in self.__dict__:
            part.__dict__["size"] = tuple(pick(a, rows) for a in self.size)
        return part

    def equations(self, rows: np.ndarray) -> np.ndarray:
        """A of some samples, its rows of length 1, (R, m, n)."""
        A = self.G[: self.m, :, rows].transpose(2, 0, 1)
        sizes = np.linalg.norm(A, axis=2, keepdims=True)
        return A / np.where(sizes > 0, sizes, 1.0)

    def forces(self, x: np.ndarray) -> np.ndarray:
        """lambda = c - B x, (k, R)."""
        return self.right[self.m :] - total(self.G[self.m :] * x, 1)


def reduce(
    problem: Problem, pattern: np.ndarray, scale: np.ndarray, weight: float, limits: bool
) -> Reduced:
    """Eliminate the contacts of every sample.

    Args: pattern: sigma of contacts with friction, (N, k), 0 for others: their force must have
          this sign, or be 0.
          limits:  whether efforts have limits and one-sided contacts push.
    """
    n, k, count = problem.n, problem.k, problem.count
    D = problem.normal - pattern[:, :, None] * problem.frictions
    # Columns: contacts, efforts, right-hand side; rows of force first, moments made forces.
    M = np.empty((6, k + n + 1, count))
    M[:, :k] = D.transpose(2, 1, 0)
    M[:, k : k + n] = problem.J.transpose(2, 1, 0)
    M[:, -1] = problem.Q.T
    M[:, -1] += total(M[:, k : k + n] * problem.offsets.T, 1)
    M[:, k : k + n] *= scale[:, None]
    M[3:] /= _lever(M[:, : k + n])
    regular = _triangular(M, k)
    # R lambda + (rows of efforts) e = right: solved for lambda from the last one up.
    for j in reversed(range(k)):
        for l in range(j + 1, k):
            M[j, k:] -= M[j, l] * M[l, k:]
        M[j, k:] /= np.where(regular, M[j, j], 1.0)
    M = np.concatenate([M[k:, k:], M[:k, k:]])
    low, high = problem.limits if limits else (np.full(n, -np.inf), np.full(n, np.inf))
    low, high = low / scale, high / scale
    push = problem.pushes if limits else np.zeros(k)
    contact_low = np.where(push > 0, problem.preload, -np.inf)
    contact_high = np.where(push < 0, -problem.preload, np.inf)
    shape = (n, count)
    return Reduced(
        G=np.ascontiguousarray(M[:, :n]),
        right=np.ascontiguousarray(M[:, n]),
        low=np.ascontiguousarray(np.broadcast_to(low[:, None], shape)),
        high=np.ascontiguousarray(np.broadcast_to(high[:, None], shape)),
        contact_low=np.maximum(contact_low[:, None], np.where(pattern.T > 0, 0.0, -np.inf)),
        contact_high=np.minimum(contact_high[:, None], np.where(pattern.T < 0, 0.0, np.inf)),
        weight=weight,
        scale=scale,
        regular=regular,
    )


def _lever(M: np.ndarray) -> np.ndarray:
    """A length that makes moments of the order of forces, (R,): a power of 2, so nothing rounds."""
    force, moment = total(total(M * M, 1).reshape(2, 3, -1), 1)
    usable = (force > 0) & (moment > 0)
    ratio = np.sqrt(np.where(usable, moment, 1.0) / np.where(usable, force, 1.0))
    return np.exp2(np.round(np.log2(ratio)))


def _triangular(M: np.ndarray, k: int) -> np.ndarray:
    """Reflect all columns so that the first k become triangular; whether they are independent."""
    regular = np.ones(M.shape[2], dtype=bool)
    lengths = np.sqrt(total(M[:, :k] ** 2, 0))
    for j in range(k):
        v = M[j:, j].copy()
        rest = np.sqrt(total(v * v, 0))
        regular &= rest > DEPENDENT * lengths[j]
        v[0] += np.copysign(rest, v[0])
        square = total(v * v, 0)
        factor = 2.0 / np.where(square > 0, square, 1.0)
        w = total(v[:, None] * M[j:, j:], 0) * factor
        M[j:, j:] -= v[:, None] * w
    return regular


def orthonormal(r: Reduced, rows: np.ndarray) -> Reduced:
    """The same equations with orthonormal rows of A in some samples: A^T = Z R, Z^T x = R^-T b.

    Efforts lose no digits by it, and multipliers then lose none either.
    """
    Z, R = np.linalg.qr(r.G[: r.m, :, rows].transpose(2, 1, 0))
    G, right = r.G.copy(), r.right.copy()
    G[: r.m, :, rows] = Z.transpose(2, 1, 0)
    b = right[: r.m, rows].T[..., None]
    right[: r.m, rows] = np.linalg.solve(R.transpose(0, 2, 1), b)[..., 0].T
    return replace(r, G=G, right=right)


def typical(r: Reduced) -> np.ndarray:
    """What the greatest |x| is not below, (R,); 1 where nothing has to be balanced."""
    rows = total(np.abs(r.G[: r.m]), 1)
    x = np.abs(r.right[: r.m]) / np.where(rows > 0, rows, np.inf)
    x = x.max(axis=0, initial=0.0)
    return np.where(x > 0, x, 1.0)
