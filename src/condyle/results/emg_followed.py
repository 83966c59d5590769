"""EMG beside activations: what `emg` and `emg_assisted` follow, and the lag between the two."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..errors import InputError, did_you_mean, join
from ..kinematics.chain.muscle import activated
from ..markers import MeasuredChannels
from ..model.model import Model

if TYPE_CHECKING:
    import xarray as xr

LONGEST = 0.3  # s, lags that are searched
_STEPS = 60  # of them, either way
STEP = LONGEST / _STEPS  # s
_BLOCK = 500_000  # numbers at a time


def measured_activation(
    model: Model, measured: MeasuredChannels | None, t: np.ndarray
) -> np.ndarray | None:
    """Activations at times t (N,) that follow from EMG, (N, n), NaN of chains without.

    An envelope over its maximum, at most 1, is the excitation; a muscle's time constants make
    activation of it, other chains' is the envelope. None where the distribution follows none.

    Raises: InputError: for EMG that is missing, does not last as long as the motion, or has gaps.
    """
    if not model.distribution.objective.follows:
        return None
    chains = model.mechanism.chain_names
    if measured is None or not measured.emg:
        where = "no measured channels are given" if measured is None else measured.source
        raise InputError(
            f"{where}: distribution {model.distribution.name} follows EMG, and there is none: give "
            "a table with columns emg_<chain> (measured=..., --measured), or [emg] in a session"
        )
    if odd := [name for name in measured.emg if name not in chains]:
        raise InputError(
            f'{measured.source}: emg: "{model.mechanism.name}" has no chain "{odd[0]}".'
            f"{did_you_mean(odd[0], chains)}"
        )
    own = {}
    for name, envelope in measured.emg.items():
        own[name], known = envelope, np.isfinite(envelope)
        chain = model.mechanism.chains[chains.index(name)]
        if chain.kind == "muscle" and known.any():
            times, u = measured.t[known], np.clip(envelope[known], 0.0, 1.0)
            m = chain.muscle  # type: ignore[union-attr]
            own[name] = np.full(len(known), np.nan)
            own[name][known] = activated(u, times, m.activation_time, m.deactivation_time)
    here = replace(measured, emg=own).at(t).emg
    if short := [name for name, a in here.items() if not np.isfinite(a).all()]:
        raise InputError(
            f"{measured.source}: EMG of {join(short)} has gaps, or ends before the motion does, "
            f"which runs from {t[0]:.6g} to {t[-1]:.6g} s; cut the motion, or fill the gaps"
        )
    nothing = np.full(len(t), np.nan)
    return np.column_stack([here.get(name, nothing) for name in chains])


@dataclass(frozen=True)
class EmgMatch:
    """An activation against its EMG, moved by the lag; unmoved where the lag is None.

    lag: of the activation behind the EMG [s], of the largest correlation within 0.3 s; None where
    that is at 0.3 s or not above 0.   correlation, rmse: of the two.
    """

    lag: float | None
    correlation: float
    rmse: float


def emg_match(
    t: np.ndarray, emg: np.ndarray, activation: np.ndarray, start: float, end: float
) -> EmgMatch | None:
    """How an activation from start to end [s] follows EMG, both (N,) at times t.

    EMG before and after counts as far as it was measured. None where either is constant, or they
    have less than 0.3 s, or half of the time, together.
    """
    times = np.arange(start, end, STEP)
    if len(times) < _STEPS:
        return None
    around = start + STEP * np.arange(-_STEPS, len(times) + _STEPS)
    x = np.interp(around, t, emg, left=np.nan, right=np.nan)
    y = np.interp(times, t, activation, left=np.nan, right=np.nan)
    moved = sliding_window_view(x, len(times))[::-1]
    block = max(_BLOCK // len(times), 1)
    blocks = range(0, len(moved), block)
    r = np.concatenate([_correlations(moved[k : k + block], y) for k in blocks])
    known = np.flatnonzero(np.isfinite(r))
    if not len(known):
        return None
    best = int(known[np.argmax(r[known])])
    peak_inside = best not in known[[0, -1]] and r[best] > 0
    row = best if peak_inside else _STEPS
    if not np.isfinite(r[row]):
        return None
    rmse = float(np.sqrt(np.nanmean((y - moved[row]) ** 2)))
    return EmgMatch((best - _STEPS) * STEP if peak_inside else None, float(r[row]), rmse)


def emg_lags(solution: xr.Dataset) -> dict[str, dict[str, float]]:
    """Chain -> lag of its activation behind its EMG [s], and their correlation there.

    As `emg_match` has them, of the whole motion; activations are those computed, or those that
    follow from EMG where they are all there is. Left out: chains without a lag, and motions of at
    most 0.6 s.
    """
    t, lags = solution["time"].values, dict[str, dict[str, float]]()
    if t[-1] - t[0] <= 2 * LONGEST:
        return {}
    for name, (emg, own) in emg_and_activation(solution).items():
        match = emg_match(t, emg, own, t[0], t[-1])
        if match is not None and match.lag is not None:
            lags[name] = {"lag": match.lag, "correlation": match.correlation}
    return lags


def emg_and_activation(solution: xr.Dataset) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Chain -> EMG and activation, (N,) each, of chains that have EMG."""
    if "emg" not in solution or "activation" not in solution:
        return {}
    both = {
        str(name): (solution["emg"].values[:, i], solution["activation"].values[:, i])
        for i, name in enumerate(solution["chain"].values)
    }
    return {name: pair for name, pair in both.items() if np.isfinite(pair[0]).any()}


def _correlations(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Correlations of rows (L, T) with y (T,), over what both have; NaN if little or constant."""
    both = np.isfinite(x) & np.isfinite(y)
    count = np.maximum(both.sum(axis=1, keepdims=True), 1)
    x, y = (np.where(both, a, 0.0) for a in (x, y))
    x, y = (np.where(both, a - a.sum(axis=1, keepdims=True) / count, 0.0) for a in (x, y))
    xx, yy, xy = ((a * b).sum(axis=1) for a, b in ((x, x), (y, y), (x, y)))
    enough = count[:, 0] >= max(_STEPS, both.shape[1] // 2)
    known = enough & (np.minimum(xx, yy) > 1e-18 * count[:, 0])
    r = np.divide(xy, np.sqrt(xx * yy), out=np.full(len(xy), np.nan), where=known)
    return np.clip(r, -1.0, 1.0)
