"""Torques of a redundantly actuated mechanism ([Cheng2023] Section 6.1).

m equations A^T tau = b for n >= m torques. The minimum-norm solution is tau = (A^T)^+ b
(eqs 65, 66), computed from singular values of A itself: the normal equations A^T A would square
its condition number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Factorisation:
    """A at N samples: A = U diag(sigma) V^T.

    U: (N, n, m)   sigma: (N, m)   V: (N, m, m)
    """

    U: np.ndarray
    sigma: np.ndarray
    V: np.ndarray

    def torques(self, b: np.ndarray) -> np.ndarray:
        """Minimum-norm solutions of A^T tau = b.

        Args:    b: (N, m, r), r right-hand sides.
        Returns: tau, (N, n, r).
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.U @ ((self.V.transpose(0, 2, 1) @ b) / self.sigma[..., None])


def minimum_norm(A: np.ndarray, scale: np.ndarray) -> Factorisation:
    """Factor the actuator Jacobian A, (N, n, m), of samples; NaN where A is not finite.

    Args: scale: (m,), divisors that give the columns one unit; they scale equations and so do not
          change torques.
    """
    good = np.isfinite(A).all(axis=(1, 2))
    count, n, m = A.shape
    U = np.full((count, n, m), np.nan)
    sigma = np.full((count, m), np.nan)
    V = np.full((count, m, m), np.nan)
    U[good], sigma[good], Vt = np.linalg.svd(A[good] / scale, full_matrices=False)
    # A = U sigma (Vt scale): the scaling moves into the right-hand side.
    V[good] = Vt.transpose(0, 2, 1) / scale[:, None]
    return Factorisation(U, sigma, V)
