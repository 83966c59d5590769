"""The spectrum of a fit's residual: weights of the fit, and deviations from what is left.

Rows are taken to frequencies by a cosine transform, in which coloured noise has independent entries
whose sizes follow its spectrum; what smoothing has removed is left out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.fft import dct

from .equations import EquationRows
from .log import WANTED

DEGREE = 3  # of the spectrum's logarithm, over the logarithm of frequency
BENT = 4.0  # of a prior against bends of it, as from so many entries
STEPS = 50  # at most, to a spectrum
RANK = 1e-6  # least singular value over the largest, of columns of length 1
CLEAR = 0.05  # least part of an entry that the fit leaves free


def in_band(rows: EquationRows, values: np.ndarray) -> np.ndarray:
    """Values (K, rows, ...), each of the stated noise's size, over frequency: (F, rows, ...).

    Entry f is of f / (2 T) Hz, with T the time of the rows; the last is of the cut-off.
    """
    root = np.linalg.cholesky(rows.V)
    flat = np.linalg.solve(root, values.reshape(*values.shape[:2], -1))
    found = dct(flat, axis=0, norm="ortho")[: -(-2 * len(flat) // WANTED)]
    return np.asarray(found.reshape(len(found), *values.shape[1:]))


def flat(values: np.ndarray, spectrum: np.ndarray) -> np.ndarray:
    """Values (F, rows, ...), of the size of a spectrum (F, rows), as rows of a matrix."""
    found = values.reshape(*spectrum.shape, -1) / np.sqrt(spectrum)[..., None]
    return np.asarray(found.reshape(spectrum.size, -1))


def stacked(values: Sequence[np.ndarray], spectrum: Sequence[np.ndarray]) -> np.ndarray:
    """As `flat`, of several logs."""
    return np.concatenate([flat(*both) for both in zip(values, spectrum, strict=True)])


def smooth_spectrum(squares: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Mean squares over frequency, (F,), from squares of single entries of a residual.

    exp of a polynomial, by the likelihood of normal entries (of Whittle): a regression of gamma
    distributed numbers. It goes on to frequency 0, where a drift is largest and the fit leaves
    little of the noise.

    Args: squares: (F,);  free: share of each entry that the fit leaves, (F,).
    """
    count = len(squares)
    place = np.log1p(np.arange(count))
    place = 2 * place / max(place[-1], 1e-9) - 1
    basis = np.polynomial.legendre.legvander(place, min(DEGREE, max(0, count // 30)))
    bend = np.where(np.arange(basis.shape[1]) > 1, BENT, 0.0)
    inverse = np.linalg.inv((basis.T * free) @ basis + np.diag(bend))
    level = np.zeros(basis.shape[1])
    level[0] = np.log(max(squares.sum() / free.sum(), np.finfo(float).tiny))
    for _ in range(STEPS):
        slope = basis.T @ (squares / np.exp(basis @ level) - free) - bend * level
        step = inverse @ slope
        largest = np.abs(basis @ step).max()
        level = level + step / max(1.0, largest)
        if largest < 1e-6:
            break
    return np.asarray(np.exp(basis @ level))


def leverage(A: np.ndarray) -> np.ndarray:
    """Share of each entry that the fit takes up, (rows,), of columns A, (rows, U) of any rank."""
    size = np.linalg.norm(A, axis=0)
    basis, values, _ = np.linalg.svd(A / np.where(size > 0, size, 1.0), full_matrices=False)
    basis = basis[:, values > RANK * values[0]]
    return np.asarray(np.minimum((basis**2).sum(axis=1), 1 - CLEAR))


def spectra(
    A: Sequence[np.ndarray], r: Sequence[np.ndarray], before: Sequence[np.ndarray]
) -> tuple[list[np.ndarray], float]:
    """Mean squares of the noise over frequency, (F, rows) of each log, and degrees of freedom.

    Args: A, r: of each log, in band, of what is fitted, and the residual;  before: an earlier
          spectrum, that the entries were weighted by.
    """
    share = leverage(stacked(A, before))
    spectrum, start = [], 0
    for residual in r:
        free = 1 - share[start : start + residual.size].reshape(residual.shape)
        both = zip((residual**2).T, free.T, strict=True)
        spectrum.append(np.column_stack([smooth_spectrum(*each) for each in both]))
        start += residual.size
    return spectrum, float(len(share) - share.sum())


def covariance(
    A: np.ndarray, r: np.ndarray, normal: np.ndarray, data: int, lines: bool
) -> np.ndarray:
    """Covariance of the fitted numbers, (U, U), from the residual's spectrum.

    Args: A, r: weighted by the spectrum, first `data` rows of logs, then of priors;  normal: of the
          step, (U, U);  lines: whether each entry's own square counts where that gives larger
          deviations (White 1980, HC3): where the residual follows the motion.
    """
    inverse = np.linalg.inv(normal)
    C = inverse @ (A.T @ A) @ inverse
    if lines:
        size = np.ones(len(r))
        size[:data] = r[:data] ** 2 / (1 - leverage(A)[:data]) ** 2
        own = inverse @ ((A * size[:, None]).T @ A) @ inverse
        wider = np.sqrt(np.maximum(1.0, np.diag(own) / np.diag(C)))
        C = C * np.outer(wider, wider)
    return np.asarray(C)
