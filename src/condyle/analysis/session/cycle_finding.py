"""Cycles in a recording: where a signal turns, and what happened between two turns."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, did_you_mean
from ...markers.recording import find_label
from ...markers.session_file import Cycles
from ...mechanism.coordinates import COORDINATES, rotations

if TYPE_CHECKING:
    import xarray as xr

    from ...markers import MarkerMotion

_AXES = "xyz"
_EMG = "emg_"


@dataclass(frozen=True, eq=False)
class CycleDetection:
    """The cycles of a trial.

    Attributes: spans: start and end of each, (C, 2) [s];  signal: that they were found by, at the
                solution's times, (N,);  unit: its unit.
    """

    spans: np.ndarray
    signal: np.ndarray
    unit: str


def find_cycles(table: Cycles | None, solution: xr.Dataset, motion: MarkerMotion) -> CycleDetection:
    """The cycles of a trial; without [cycles] the whole trial is one.

    Raises: InputError: for a signal that is not there.
    """
    t = solution["time"].values
    if table is None:
        return CycleDetection(np.array([[t[0], t[-1]]]), np.zeros(len(t)), "")
    signal, unit = _signal(table.by, solution, motion)
    return CycleDetection(spans(t, signal, table), signal, unit)


def spans(t: np.ndarray, signal: np.ndarray, table: Cycles) -> np.ndarray:
    """Starts and ends of cycles, (C, 2) [s]: from one turning point of a signal to the next.

    Turning points are as far apart as the shortest cycle and as deep as `prominence` of the
    signal's range; where two are too near, the deeper one stays. Their time is that of the vertex
    of the parabola through three samples. Samples that are not finite end a cycle.
    """
    from scipy.signal import find_peaks

    x = signal if table.turn == "maximum" else -signal
    known = np.isfinite(x)
    if known.sum() < 3 or not np.ptp(x[known]):
        return np.empty((0, 2))
    step = float(np.median(np.diff(t)))
    filled = np.where(known, x, x[known].min())
    apart = max(table.shortest / step * (1 - 1e-9), 1.0)
    at, _ = find_peaks(filled, distance=apart, prominence=table.prominence * np.ptp(x[known]))
    before, here, after = filled[at - 1], filled[at], filled[at + 1]
    bend = before - 2 * here + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, 1.0), 0.0)
    turns = t[at] + shift * step
    whole = [bool(known[i : j + 1].all()) for i, j in pairwise(at)]
    found = np.column_stack([turns[:-1], turns[1:]])[np.array(whole, dtype=bool)]
    longest = np.inf if table.longest is None else table.longest
    return found[np.diff(found, axis=1)[:, 0] <= longest]


def at_times(t: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Samples (N, ...) at other times, linear between them, times.shape + (...)."""
    values = np.asarray(values, dtype=float)
    right = np.clip(np.searchsorted(t, times, side="right"), 1, len(t) - 1)
    share = ((times - t[right - 1]) / (t[right] - t[right - 1])).reshape(
        times.shape + (1,) * (values.ndim - 1)
    )
    low, high = values[right - 1], values[right]
    # What stands on a sample is that sample, whatever is beside it.
    with np.errstate(invalid="ignore"):  # infinite margins
        return np.where(share == 0, low, np.where(share == 1, high, low + share * (high - low)))


def _signal(by: str, solution: xr.Dataset, motion: MarkerMotion) -> tuple[np.ndarray, str]:
    """What cycles are found by, at the solution's times, (N,), and its unit."""
    pose, t = solution["pose"].values, solution["time"].values
    if by in COORDINATES:
        return pose[:, COORDINATES.index(by)], "m" if by in "XYZ" else "rad"
    emg = motion.channels.emg
    if by.startswith(_EMG) and by[len(_EMG) :] in emg:
        return np.interp(t, motion.channels.t, emg[by[len(_EMG) :]]), "1"
    points = solution.condyle.mechanism.platform.points
    name, _, axis = by.rpartition(".")
    if name in points and axis in (*_AXES,):
        place = rotations(pose[:, 3:]) @ np.array(points[name]) + pose[:, :3]
        return place[:, _AXES.index(axis)], "m"
    recording: Any = motion.recording
    try:
        label = find_label(by, recording.channels, recording.source, "channel")
    except InputError:
        known = [*COORDINATES, *(f"{p}.{a}" for p in points for a in _AXES)]
        known += [*(_EMG + chain for chain in emg), *filter(None, recording.channels)]
        raise InputError(
            f'cycles: by: "{by}" is no coordinate, component of a landmark, EMG of a chain or '
            f"channel of {recording.source}.{did_you_mean(by, known)}"
        ) from None
    return np.interp(t, recording.t, recording.analog[:, label]), recording.channel_units[label]
