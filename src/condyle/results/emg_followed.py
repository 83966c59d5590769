"""EMG beside activations: what `emg` and `emg_assisted` follow, and the lag between the two."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, did_you_mean, few
from ..kinematics.chain.muscle import activated
from ..markers import MeasuredChannels
from ..model.model import Model

if TYPE_CHECKING:
    import xarray as xr

LONGEST = 0.3  # s, lags that are searched
_STEPS = 60  # of them, either way


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
            f"{measured.source}: EMG of {few(short)} has gaps, or ends before the motion does, "
            f"which runs from {t[0]:.6g} to {t[-1]:.6g} s; cut the motion, or fill the gaps"
        )
    nothing = np.full(len(t), np.nan)
    return np.column_stack([here.get(name, nothing) for name in chains])


def emg_lags(solution: xr.Dataset) -> dict[str, dict[str, float]]:
    """Chain -> lag of its activation behind its EMG [s], and their correlation there.

    The lag within 0.3 s with the largest correlation of the two over the samples that both have;
    activations are those computed, or those that follow from EMG where they are all there is. Left
    out: chains whose EMG or activation is constant, or whose correlation still grows at 0.3 s, and
    motions shorter than twice that.
    """
    if "emg" not in solution or "activation" not in solution:
        return {}
    t, found = solution["time"].values, dict[str, dict[str, float]]()
    times = np.arange(t[0], t[-1], LONGEST / _STEPS)
    if len(times) <= 2 * _STEPS:
        return {}
    for name in solution["chain"].values:
        emg, own = (solution[v].sel(chain=name).values for v in ("emg", "activation"))
        x, y = (_interpolated(times, t, a) for a in (emg, own))
        r = np.array([_correlation(x, y, shift) for shift in range(-_STEPS, _STEPS + 1)])
        if not np.isfinite(r).any():
            continue
        best = int(np.nanargmax(r))
        if best in (0, len(r) - 1):
            continue
        found[str(name)] = {
            "lag": (best - _STEPS) * LONGEST / _STEPS,
            "correlation": float(r[best]),
        }
    return found


def _interpolated(times: np.ndarray, t: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.interp(times, t, values)


def _correlation(x: np.ndarray, y: np.ndarray, shift: int) -> float:
    """Of y, earlier by so many samples, with x; NaN where one is constant."""
    n = len(x) - abs(shift)
    x, y = x[max(-shift, 0) :][:n], y[max(shift, 0) :][:n]
    both = np.isfinite(x) & np.isfinite(y)
    x, y = x[both], y[both]
    if len(x) < _STEPS or min(np.ptp(x), np.ptp(y)) < 1e-9:
        return np.nan
    return float(np.corrcoef(x, y)[0, 1])
