"""Torques of a redundantly actuated mechanism ([Cheng2023] Section 6.1).

m equations A^T tau = b for n >= m torques. The minimum-norm solution is tau = (A^T)^+ b
(eqs 65, 66), computed from singular values of A itself: the normal equations A^T A would square
its condition number.
"""

from __future__ import annotations

import numpy as np


def minimum_norm(A: np.ndarray, scale: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Minimum-norm solutions of A^T tau = b at N samples; NaN where A is not finite.

    Args:    A: actuator Jacobian, (N, n, m).   b: (N, m, r), r right-hand sides.
             scale: (m,), divisors that give the columns of A one unit; they scale equations and
             so do not change torques.
    Returns: tau, (N, n, r).
    """
    tau, good = np.full((*A.shape[:2], b.shape[2]), np.nan), np.isfinite(A).all(axis=(1, 2))
    U, sigma, Vt = np.linalg.svd(A[good] / scale, full_matrices=False)
    with np.errstate(divide="ignore", invalid="ignore"):
        tau[good] = U @ ((Vt @ (b[good] / scale[:, None])) / sigma[..., None])
    return tau
