"""Smoothing of measured motions: a low-pass filter in the form of a penalised spline."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import progress
from ..errors import InputError
from .arrays import as_number
from .column_units import ANGLE_UNITS, POSE
from .spline import Spline, basis

AUTO_CUTOFF = 10.0
"""Cut-off of "auto" [Hz]. Chewing repeats one to two times a second, so at least five harmonics
pass. Above them noise of markers and encoders prevails, and two derivatives raise it with the
square of the frequency."""

_DEGREE = 5
_ORDER = 4  # of the penalised differences
_KNOTS_PER_PERIOD = 8  # of the cut-off
_MIN_PERIODS = 2  # of the cut-off, that a recording must last
EDGE = 0.5
"""Periods of the cut-off at either end in which noise passes more than in the middle: in
accelerations 7 times as much at the end, 1.2 times this far from it."""


@dataclass(frozen=True, eq=False)
class Smoothing:
    """What smoothing removed, at the times of the input.

    Attributes: cutoff: frequency at which the amplitude is 1/sqrt(2) [Hz].
                automatic: whether the cut-off is the default one.
                names: columns, (m,).
                rms, peak: root of the mean square, and largest size, of the removed part, (m,),
                    [m] or [rad].
    """

    cutoff: float
    automatic: bool
    names: tuple[str, ...]
    rms: np.ndarray
    peak: np.ndarray

    def __str__(self) -> str:
        parts = []
        for name, rms, peak in zip(self.names, self.rms, self.peak, strict=True):
            unit, size = ("deg", ANGLE_UNITS["deg"]) if name in POSE[3:] else ("mm", 1e-3)
            parts.append(f"{name} {rms / size:.3g} {unit} rms ({peak / size:.3g} at most)")
        return f"smoothing at {self.cutoff:g} Hz removed " + ", ".join(parts)


def parse_cutoff(cutoff: float | str) -> float:
    """Cut-off in Hz from a number or "auto"."""
    given: object = AUTO_CUTOFF if isinstance(cutoff, str) and cutoff == "auto" else cutoff
    if isinstance(given, str):  # of the command line
        with suppress(ValueError):
            given = float(given)
    return as_number(given, "cutoff", 'a frequency above 0 Hz, or "auto"', lambda f: f > 0)


def smoothing_spline(t: np.ndarray, values: np.ndarray, cutoff: float) -> Spline:
    """Values smoothed by `LowPass`.

    Args:   t: (N,) [s], rising from 0. values: (N, m). cutoff: [Hz].
    Returns: s, of N' knots that do not depend on N.
    Raises:  InputError: if the samples are too sparse or too few for the cut-off.
    """
    with progress.step("smoothing"):
        return LowPass(t, cutoff).spline(values)


class LowPass:
    """Quintic smoothing spline: a low-pass filter with the cut-off frequency `cutoff`.

        min over c:  sum_i |y_i - s(t_i)|^2 + mu sum_j |D^4 c_j|^2,   s = sum_j c_j B_j

    with B_j on even knots, eight to a period of the cut-off. For even, dense samples its gain is

        1 / (1 + mu' (2 sin(w h/2))^8 / sinc(w h/2)^12),

    where h is the knot step: that of a Butterworth filter of order 4 run forward and backward, with
    mu' such that it is 1/sqrt(2) at the cut-off. Unlike the filter it needs no made-up samples
    beyond the ends (a cubic passes unchanged, up to the ends) and takes uneven samples as they are.
    """

    def __init__(self, t: np.ndarray, cutoff: float) -> None:
        """As `smoothing_spline`."""
        from scipy.interpolate import BSpline
        from scipy.sparse import diags_array
        from scipy.sparse.linalg import splu

        _check_cutoff(t, cutoff)
        intervals = math.ceil(_KNOTS_PER_PERIOD * cutoff * t[-1])
        step = t[-1] / intervals
        self._knots = knots = step * np.arange(-_DEGREE, intervals + _DEGREE + 1)
        B = BSpline.design_matrix(np.minimum(t, knots[-_DEGREE - 1]), knots, _DEGREE)
        size = intervals + _DEGREE
        binomials = [(-1.0) ** i * math.comb(_ORDER, i) for i in range(_ORDER + 1)]
        D = diags_array(binomials, offsets=range(_ORDER + 1), shape=(size - _ORDER, size))

        half_turn = math.pi * cutoff * step
        samples_per_knot = (len(t) - 1) / intervals
        spline_gain = np.sinc(half_turn / math.pi) ** (2 * (_DEGREE + 1))
        mu = (math.sqrt(2) - 1) * spline_gain / (2 * math.sin(half_turn)) ** (2 * _ORDER)
        self._B = B
        self._factor = splu((B.T @ B + mu * samples_per_knot * (D.T @ D)).tocsc())

    def spline(self, values: np.ndarray) -> Spline:
        """The smoothed values. Args: values: (N, m)."""
        found = self._factor.solve(self._B.T @ np.asarray(values, dtype=float))
        return Spline(self._knots, found.reshape(len(found), -1), _DEGREE)

    def back(self, weights: np.ndarray, times: np.ndarray, nu: int = 0) -> np.ndarray:
        """Weights of the values, (N, m), in a sum of the spline's derivatives of order `nu`.

        Args: weights: (K, m), of s^(nu) at times (K,).
        """
        return self._B @ self._factor.solve(design(self._knots, times, nu).T @ weights)


def design(knots: np.ndarray, times: np.ndarray, nu: int) -> Any:
    """Derivatives of order `nu` of all quintic B-splines at times, (K, M), sparse."""
    from scipy.sparse import csr_array

    first, rows = basis(knots, times, _DEGREE, nu)
    columns = first[:, None] + np.arange(_DEGREE + 1)
    starts = np.arange(0, rows.size + 1, _DEGREE + 1)
    shape = (len(times), len(knots) - _DEGREE - 1)
    return csr_array((rows.ravel(), columns.ravel(), starts), shape=shape)


def _check_cutoff(t: np.ndarray, cutoff: float) -> None:
    gap = np.diff(t).max()
    if cutoff >= 0.5 / gap * (1 - 1e-9):
        raise InputError(
            f"cut-off {cutoff:g} Hz: must be below half the sampling rate, {0.5 / gap:.4g} Hz"
            f" (the longest step is {gap:.4g} s)"
        )
    if t[-1] < _MIN_PERIODS / cutoff:
        raise InputError(
            f"cut-off {cutoff:g} Hz: needs a recording of at least {_MIN_PERIODS / cutoff:.3g} s"
            f" ({_MIN_PERIODS} periods), got {t[-1]:.3g} s. Raise the cut-off, or do not smooth."
        )
