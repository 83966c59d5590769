"""Singularities ([Cheng2023] Section 3.3, eqs 25-28), with dimensionless measures.

L_i = |S_i - M_i|^2 - |S_i M_i|^2 gives J_A theta' + J_W q' = 0. Divided by twice crank times
coupler, J_A becomes the sine of the transmission angle; divided by twice the coupler, and with
angles multiplied by the characteristic length, J_W becomes dimensionless as well. Then

    inverse:   the smallest |J_A| over the largest is near 0,
    direct:    the smallest singular value of J_W over the largest is near 0,
    combined:  both.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np

NEAR = 1e-3  # ratio below which a pose is near a singularity,
SINGULAR = 1e-12  # and below which it is at one
KINDS = ("none", "inverse", "direct", "combined")


@dataclass(frozen=True)
class Singularity:
    """Measures at N samples.

    J_A:             diagonal of eq. (26), (N, n) [m^2 per joint unit].
    transmission:    J_A made dimensionless, (N, n): 1 is best.
    J_W_sigma:       singular values of the dimensionless J_W, (N, m), falling.
    length:          the characteristic length [m].
    """

    J_A: np.ndarray
    transmission: np.ndarray
    J_W_sigma: np.ndarray
    length: float

    @property
    def inverse_ratio(self) -> np.ndarray:
        """Smallest over largest entry of J_A, (N,)."""
        size = np.abs(self.transmission).T  # by columns: far quicker than along short rows
        return _ratio(reduce(np.minimum, size), reduce(np.maximum, size))

    @property
    def direct_ratio(self) -> np.ndarray:
        """Smallest over largest singular value of J_W, (N,)."""
        return _ratio(self.J_W_sigma[:, -1], self.J_W_sigma[:, 0])

    @property
    def ratio(self) -> np.ndarray:
        """The smaller of the two ratios, (N,)."""
        return np.minimum(self.inverse_ratio, self.direct_ratio)

    @property
    def condition(self) -> np.ndarray:
        """Condition number of the dimensionless J_W, (N,)."""
        with np.errstate(divide="ignore"):
            return 1.0 / self.direct_ratio

    @property
    def rank(self) -> np.ndarray:
        """Rank of J_W, (N,): singular values above `SINGULAR` times the largest."""
        least = SINGULAR * self.J_W_sigma[:, 0]
        return np.add.reduce([sigma > least for sigma in self.J_W_sigma.T], dtype=np.int8)

    def kind(self, threshold: float = NEAR) -> np.ndarray:
        """Index into `KINDS` of what each sample is near to, (N,)."""
        return (self.inverse_ratio < threshold) + 2 * (self.direct_ratio < threshold)


def measure(
    J_A: np.ndarray,
    J_A_scale: np.ndarray,
    J_W: np.ndarray,
    rod_length: np.ndarray,
    angle_columns: np.ndarray,
    length: float,
) -> Singularity:
    """Measures from the matrices of eq. (26).

    Args: J_A, J_A_scale, rod_length: (N, n);  J_W: (N, n, m);
          angle_columns: (m,), True where a coordinate is an angle;  length: [m].
    """
    scaled = J_W / (2 * rod_length[..., None]) / np.where(angle_columns, length, 1.0)
    sigma = np.full((len(J_W), J_W.shape[2]), np.nan)
    good = np.isfinite(scaled).all(axis=(1, 2))
    sigma[good] = np.linalg.svd(scaled[good], compute_uv=False)
    return Singularity(J_A, J_A / J_A_scale, sigma, length)


def _ratio(small: np.ndarray, large: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(large > 0, small / large, np.where(np.isnan(large), np.nan, 0.0))
