"""One sample with given friction signs, its contact forces eliminated.

An orthogonal transformation turns the six equations into m = 6 - k for the efforts, with
orthonormal rows, and the contact forces that follow from them:

    G x + (0, y) = right,    effort = unit scale x,    lambda = unit measure y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .problem import Problem

DEPENDENT = 1e-11  # sine of the angle to other columns below which a contact is redundant
SINGULAR = 1e-12  # ratio of singular values of A below which efforts are not determined


@dataclass(frozen=True)
class Sample:
    """G (6, n) and right (6,), rows of efforts alone first; bounds of x and of contact forces y.

    weight:  W of half the sum of squares of y.
    unit:    common scale, which makes the largest entries of the order of one.
    measure: additional scale of contact forces, which balances them against the efforts.
    """

    G: np.ndarray
    right: np.ndarray
    low: np.ndarray
    high: np.ndarray
    contact_low: np.ndarray
    contact_high: np.ndarray
    weight: float = 0.0
    unit: float = 1.0
    measure: float = 1.0

    @classmethod
    def of(
        cls, p: Problem, i: int, sigma: np.ndarray, scale: np.ndarray, weight: float, limits: bool
    ) -> Sample | None:
        """Sample i; None where efforts or contact forces are not determined.

        Args: sigma: signs of the contact forces with friction, (k,), 0 for others; a force may
              also vanish.
              limits: whether effort limits and unilateral contacts apply.
        """
        n, k = p.n, p.k
        D = (p.normal[i] - sigma[:, None] * p.friction[i]).T
        M = np.column_stack([p.J[i].T * scale, p.Q[i] + p.J[i].T @ p.offset[i]])
        D, M = _levelled(D, M)
        greatest = [np.linalg.norm(a, axis=0).max(initial=0.0) for a in (M[:, :n], D)]
        measure = float(np.exp2(np.round(np.log2(np.divide(*greatest))))) if min(greatest) else 1.0
        D = D * measure
        turn, R = np.linalg.qr(D, mode="complete")
        if (np.abs(np.diag(R)) <= DEPENDENT * np.linalg.norm(D, axis=0)).any():
            return None
        M = turn.T @ M
        A, b = M[k:, :n], M[k:, n]
        carried = np.linalg.solve(R[:k], M[:k])
        sizes = np.linalg.norm(A, axis=1, keepdims=True)
        sigmas = np.linalg.svd(A / np.where(sizes > 0, sizes, 1.0), compute_uv=False)
        if n < 6 - k or not sigmas[-1] > SINGULAR * sigmas[0]:
            return None
        Z, T = np.linalg.qr(A.T)
        G = np.vstack([Z.T, carried[:, :n]])
        right = np.concatenate([np.linalg.solve(T.T, b), carried[:, n]])
        ends = (x if x.ndim == 1 else x[i] for x in (p.low, p.high))
        low, high = (x / scale for x in ends) if limits else (-np.inf, np.inf)
        push, least = (p.push, p.preload / measure) if limits else (0 * p.push, 0.0)
        bounds = (
            np.broadcast_to(low, n),
            np.broadcast_to(high, n),
            np.maximum(np.where(push > 0, least, -np.inf), np.where(sigma > 0, least, -np.inf)),
            np.minimum(np.where(push < 0, -least, np.inf), np.where(sigma < 0, -least, np.inf)),
        )
        unit = float(np.abs(right[: 6 - k]).max(initial=0.0))
        if not unit:
            sizes = np.abs(np.concatenate([*bounds, right]))
            unit = float(np.max(sizes, where=np.isfinite(sizes), initial=0.0)) or 1.0
        a, b, c, d = (bound / unit for bound in bounds)
        return cls(G, right / unit, a, b, c, d, weight * measure**2, unit, measure)

    @property
    def m(self) -> int:
        return 6 - len(self.contact_low)

    @property
    def contradictory(self) -> bool:
        """Whether the bounds of a contact force exclude each other."""
        return bool((self.contact_low > self.contact_high).any())

    def force(self, x: np.ndarray) -> np.ndarray:
        """y, (k,), within its bounds."""
        left = self.right[self.m :] - self.G[self.m :] @ x
        return np.minimum(np.maximum(left, self.contact_low), self.contact_high)

    def complete(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Matrix and bounds of z = (x, y): six equations for all unknowns."""
        columns = np.eye(6)[:, self.m :]
        low, high = (self.low, self.contact_low), (self.high, self.contact_high)
        return np.hstack([self.G, columns]), np.concatenate(low), np.concatenate(high)


def _levelled(D: np.ndarray, M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moments divided by a length, a power of 2, that makes them of the order of forces."""
    force, moment = (np.sum(D[a] ** 2) + np.sum(M[a, :-1] ** 2) for a in (slice(3), slice(3, 6)))
    usable = force > 0 and moment > 0
    rows = np.ones((6, 1))
    rows[3:] = np.exp2(-np.round(0.5 * np.log2(moment / force))) if usable else 1.0
    return D * rows, M * rows
