"""Places of markers on the platform at the times of a table's rows, from a recording of markers."""

from __future__ import annotations

import numpy as np

from ..errors import InputError, join
from ..markers.recorded_tables import read_recording
from ..markers.recording import find_label
from ..markers.rigid import FEWEST, common_shape, fit
from .calibration_study import Markers

DRIFT = 1e-3  # m between the halves of a row's window, beyond which the platform was moving


def marked_points(markers: Markers, t: np.ndarray) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Places of the platform's markers at times t [s], (N, 3) [m] each, and what to know of them.

    The mean over a window about each time, in the laboratory, or, where fixed markers are named, in
    the frame in which these stand still. NaN where a marker was not seen.

    Raises: InputError: for labels that are not there, and times outside the recording.
    """
    recording = read_recording(markers.file, markers.unit)
    places = [find_label(name, recording.labels, recording.source) for name in markers.platform]
    points = recording.points[:, places]
    if markers.fixed:
        own = [find_label(name, recording.labels, recording.source) for name in markers.fixed]
        body = fit(common_shape(recording.points[:, own]), recording.points[:, own])
        if not body.determined.any():
            raise InputError(
                f"{recording.source}: at no time are {FEWEST} of the fixed markers "
                f"{join(markers.fixed)} seen together, off one line"
            )
        points = body.back(points)
    half = max(markers.window, 1 / recording.rate) / 2
    first, last = recording.t[0] - half, recording.t[-1] + half
    off = np.flatnonzero((t < first) | (t > last))
    if len(off):
        raise InputError(
            f"poses: row {off[0] + 1} is at {t[off[0]]:.6g} s, and {recording.source} runs from "
            f"{recording.t[0]:.6g} to {recording.t[-1]:.6g} s"
        )
    slack = 1e-6 / recording.rate
    ends = np.searchsorted(recording.t, [t - half - slack, t + half + slack]).T
    windows = [points[start:end] for start, end in ends]
    means = np.array([_mean(window) for window in windows])
    halves = [(w[: len(w) // 2], w[(len(w) + 1) // 2 :]) for w in windows if len(w) > 3]
    drift = max((np.nanmax(np.abs(_mean(a) - _mean(b)), initial=0.0) for a, b in halves), default=0)
    notes = list(recording.warnings)
    if drift > DRIFT:
        notes.append(
            f"{recording.source}: the platform moves by up to {drift * 1e3:.3g} mm within "
            f"{markers.window:g} s about a row; hold it still, or take a shorter window"
        )
    unseen = [n for n, p in zip(markers.platform, means.swapaxes(0, 1), strict=True) if _none(p)]
    if unseen:
        raise InputError(f"{recording.source}: {join(unseen)} not seen at any row of the poses")
    return dict(zip(markers.platform, means.swapaxes(0, 1), strict=True)), tuple(notes)


def _mean(points: np.ndarray) -> np.ndarray:
    """Mean of the frames, (F, m, 3), in which a marker was seen, (m, 3); NaN where in none."""
    seen = np.isfinite(points)
    count = seen.sum(axis=0)
    total = np.where(seen, points, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _none(places: np.ndarray) -> bool:
    return not np.isfinite(places).any()
