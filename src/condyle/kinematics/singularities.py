"""Singularities ([Cheng2023] Section 3.3, eqs 25-28), with dimensionless measures.

L_i = |S_i - M_i|^2 - |S_i M_i|^2 gives J_A theta' + J_W q' = 0. Divided by twice crank times
coupler, J_A becomes the sine of the transmission angle. J_W is taken on the twists [V; L omega]
that the contacts admit, L the characteristic length, in orthonormal coordinates, and divided by
twice the coupler. Then

    inverse:   the smallest |J_A| over the largest is near 0,
    direct:    the smallest singular value of J_W over the largest is near 0,
    combined:  both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NEAR_SINGULAR = 1e-3  # ratio below which a pose is near-singular,
SINGULAR = 1e-12  # and below which it is singular
KINDS = ("none", "inverse", "direct", "combined")


@dataclass(frozen=True)
class Singularity:
    """Measures at N samples.

    J_A:             diagonal of eq. (26), (N, n) [m^2 per joint unit].
    transmission:    J_A made dimensionless, (N, n): 1 is best.
    J_W_sigma:       singular values of the dimensionless J_W, (N, m), decreasing.
    inverse_ratio:   smallest over largest |transmission|, (N,).
    direct_ratio:    smallest over largest singular value of J_W, (N,).
    ratio:           the smaller of the two, (N,).
    length:          the characteristic length [m].
    """

    J_A: np.ndarray
    transmission: np.ndarray
    J_W_sigma: np.ndarray
    inverse_ratio: np.ndarray
    direct_ratio: np.ndarray
    ratio: np.ndarray
    length: float

    @staticmethod
    def of(
        J_A: np.ndarray,
        transmission: np.ndarray,
        J_W_sigma: np.ndarray,
        J_A_extremes: np.ndarray,
        length: float,
    ) -> Singularity:
        """Args: J_A_extremes: smallest and largest |transmission|, (2, N)."""
        inverse = ratio(J_A_extremes[0], J_A_extremes[1])
        direct = ratio(J_W_sigma[:, -1], J_W_sigma[:, 0])
        both = np.minimum(inverse, direct)
        return Singularity(J_A, transmission, J_W_sigma, inverse, direct, both, length)

    @property
    def condition(self) -> np.ndarray:
        """Condition number of the dimensionless J_W, (N,)."""
        with np.errstate(divide="ignore"):
            return 1.0 / self.direct_ratio

    @property
    def rank(self) -> np.ndarray:
        """Rank of J_W, (N,): singular values above `SINGULAR` times the largest."""
        sigma = np.moveaxis(self.J_W_sigma, -1, 0)
        return np.add.reduce([one > SINGULAR * sigma[0] for one in sigma], dtype=np.int8)

    def kind(self, threshold: float = NEAR_SINGULAR) -> np.ndarray:
        """Index into `KINDS` of the nearest singularity, (N,)."""
        return (self.inverse_ratio < threshold) + 2 * (self.direct_ratio < threshold)


def length_sensitivity(J_W: np.ndarray, N: np.ndarray, transmission: np.ndarray) -> np.ndarray:
    """d log ratio / d log L of the `ratio` with the characteristic length L, (samples,).

    Between -1 and 1: a singular value of J_W falls by the share of turning in its twist,
    d log sigma / d log L = -|L omega|^2 / (|V|^2 + |L omega|^2). 0 where the ratio is the inverse
    one.

    Args: J_W: on [V; L omega], dimensionless, (samples, n, 6);  N: wrenches of the contacts, dual
          to these, (samples, k, 6);  transmission: (samples, n).
    """
    known = np.isfinite(J_W).all(axis=(1, 2)) & np.isfinite(N).all(axis=(1, 2))
    if not known.all():
        found = np.full(len(J_W), np.nan)
        if known.any():
            found[known] = length_sensitivity(J_W[known], N[known], transmission[known])
        return found
    free = admitted_twists(N)
    _, sigma, Vt = np.linalg.svd(J_W @ free.transpose(0, 2, 1))
    turning = ((Vt @ free)[..., 3:] ** 2).sum(axis=2)
    size = np.abs(transmission)
    inverse, direct = ratio(size.min(axis=1), size.max(axis=1)), ratio(sigma[:, -1], sigma[:, 0])
    return np.where(direct <= inverse, turning[:, 0] - turning[:, -1], 0.0)


def admitted_twists(N: np.ndarray) -> np.ndarray:
    """Orthonormal twists that contacts admit, as rows, (samples, 6 - k, 6).

    Args: N: wrenches of the contacts, dual to the twists, (samples, k, 6), finite.
    """
    k = N.shape[1]
    return np.linalg.svd(np.pad(N, ((0, 0), (0, 6 - k), (0, 0))))[2][:, k:]


def ratio(small: np.ndarray, large: np.ndarray) -> np.ndarray:
    """small / large; 0 where both vanish."""
    with np.errstate(invalid="ignore", divide="ignore"):
        found = small / large
    found[large == 0] = 0.0
    return found
