"""Cycles in a recording: where a signal turns, and what happened between two turns."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import InputError, did_you_mean
from ...markers.recording import find_label
from ...markers.session_file import STATIC, Cycles
from ...mechanism.coordinates import COORDINATES, rotations
from ...motion.arrays import runs_of
from .incisor import PATHS, POINT, has_incisor, way_of

if TYPE_CHECKING:
    import xarray as xr

    from ...markers import Recording

_AXES = "xyz"
_EMG = "emg_"
# Of `least`: what it is multiplied by, and the smallest amplitude that counts without it.
_SCALES = {"m": (1e-3, 1e-3), "rad": (np.pi / 180, np.radians(0.5))}
_SLOW = 0.1  # of a movement's largest speed, below which it has not begun, or has ended
_LOW = 0.25  # of a movement's amplitude, within which its beginning and end are sought
_WINDOW = 0.1  # s, over which a speed is taken
PHASES = ("opening", "closing", "occlusal", "rest")


class Spans(NamedTuple):
    """Cycles of a signal.

    ends: start and end of each, (C, 2) [s];  phases: durations of `PHASES`, (C, 4) [s]: from the
    first turn to the second, back, stopped until the next one begins, and at rest until then (NaN
    after the last).
    """

    ends: np.ndarray
    phases: np.ndarray


@dataclass(frozen=True, eq=False)
class CycleDetection:
    """The cycles of a trial.

    Attributes: spans: start and end of each, (C, 2) [s];  phases: as of `Spans`; None where the
                trial is one cycle.
                signal: that they were found by, at the solution's times, (N,);  unit: its unit.
    """

    spans: np.ndarray
    phases: np.ndarray | None
    signal: np.ndarray
    unit: str


def find_cycles(
    table: Cycles | None,
    solution: xr.Dataset,
    recording: Recording,
    task: str = "",
    axes: np.ndarray | None = None,
) -> CycleDetection:
    """The cycles of a trial; without [cycles] the whole trial is one, a static trial has none.

    Raises: InputError: for a signal that is not there.
    """
    t = solution["time"].values
    if table is None or task == STATIC:
        whole = np.array([[t[0], t[-1]]])[: int(task != STATIC)]
        return CycleDetection(whole, None, np.zeros(len(t)), "")
    signal, unit = _signal(table.by, solution, recording, axes)
    return CycleDetection(*spans(t, signal, table, unit), signal, unit)


def spans(t: np.ndarray, signal: np.ndarray, table: Cycles, unit: str = "rad") -> Spans:
    """Cycles from one turning point of a signal to the next; the first may begin at rest.

    A turning point counts if the signal moves by `least` on both sides of it, or on one, where it
    rests at an end of the recording as deep as elsewhere; of two that are nearer than `shortest`
    the deeper one. A cycle begins as the signal leaves it, faster than a tenth of the movement's
    largest speed, and ends as the next one begins; where the signal stops for longer than `rest`,
    as it slows down. Samples that are not finite, and gaps in time, end a cycle.
    """
    step = float(np.median(np.diff(t)))
    known = np.isfinite(signal)
    amplitude = _amplitude(signal[known], table, unit)
    up = signal if table.turn == "minimum" else -signal
    apart = np.concatenate([[False], np.diff(t) > 1.5 * step])
    ends, phases = [np.empty((0, 2))], [np.empty((0, 4))]
    for run in runs_of(known):
        cuts = [run.start, *(run.start + np.flatnonzero(apart[run])), run.stop]
        for a, b in pairwise(sorted({*cuts})):
            if b - a >= 5 and amplitude:
                found = _of_run(t[a:b], up[a:b], amplitude, table, step)
                ends.append(found.ends)
                phases.append(found.phases)
    every = Spans(np.concatenate(ends), np.concatenate(phases))
    low, high = table.within or (-np.inf, np.inf)
    longest = np.inf if table.longest is None else table.longest
    kept = (np.diff(every.ends, axis=1)[:, 0] <= longest) & (every.ends[:, 0] >= low)
    kept &= every.ends[:, 1] <= high
    return Spans(every.ends[kept], every.phases[kept])


def _amplitude(signal: np.ndarray, table: Cycles, unit: str) -> float:
    """The smallest amplitude of a cycle, in the signal's unit."""
    scale, floor = _SCALES.get(unit, (1.0, 0.0))
    if table.least is not None:
        return table.least * scale
    return max(table.prominence * float(np.ptp(signal)), floor) if np.any(np.diff(signal)) else 0.0


def _of_run(t: np.ndarray, y: np.ndarray, amplitude: float, table: Cycles, step: float) -> Spans:
    """Cycles between minima of y, without gaps."""
    at = _minima(y, amplitude)
    shortest = table.shortest * (1 - 1e-9)
    while len(at) > 1 and (gaps := np.diff(t[at])).min() < shortest:
        i = int(np.argmin(gaps))
        del at[i if y[at[i]] > y[at[i + 1]] else i + 1]
    width = min(max(2 * round(_WINDOW / step / 2) + 1, 5), len(y) - 1 + len(y) % 2)
    speed = _speed(y, width, step)
    tops = [i + int(np.argmax(y[i : j + 1])) for i, j in pairwise(at)]
    turns = [
        _Turn.of(t, y, speed, i, before, after, amplitude)
        for i, before, after in zip(at, [None, *tops], [*tops, None], strict=True)
    ]
    ends, phases = [], []
    for (first, last), top in zip(pairwise(turns), tops, strict=True):
        if first.still and last.still:
            stop = last.leaves - last.reached
            occlusal = stop if last.goes_on and stop <= table.rest else 0.0
            end = last.reached + occlusal
            rest = last.leaves - end if last.goes_on else np.nan
            ends.append((first.leaves, end))
            phases.append((t[top] - first.leaves, last.reached - t[top], occlusal, rest))
    return Spans(np.array(ends).reshape(-1, 2), np.array(phases).reshape(-1, 4))


def _speed(y: np.ndarray, width: int, step: float) -> np.ndarray:
    """Slope of the parabola nearest to `width` samples about each (Savitzky and Golay 1964); at
    the ends of that of the first and of the last. SciPy's own takes a second to be imported.
    """
    half = width // 2
    places = np.arange(-half, half + 1)
    inside = np.correlate(y, places / (places @ places), "valid")
    first, last = (
        np.polyval(np.polyder(np.polyfit(places, part, 2)), places)
        for part in (y[:width], y[-width:])
    )
    return np.concatenate([first[:half], inside, last[half + 1 :]]) / step


def _minima(y: np.ndarray, amplitude: float) -> list[int]:
    """Lowest samples between falls and rises of an amplitude, at both ends too."""
    minima, low, high, falling = [], 0, 0, True
    for i, value in enumerate(y.tolist()):
        if falling:
            low = i if value < y[low] else low
            if value - y[low] >= amplitude:
                minima.append(low)
                high, falling = i, False
        else:
            high = i if value > y[high] else high
            if y[high] - value >= amplitude:
                low, falling = i, True
    return [*minima, low] if falling else minima


class _Turn(NamedTuple):
    """A minimum: when the movement to it has ended (`reached`), and the one from it begins [s].

    still: it is a turning point, and no end of the recording amid a movement.
    goes_on: a movement from it was seen.
    """

    reached: float
    leaves: float
    still: bool
    goes_on: bool

    @classmethod
    def of(
        cls,
        t: np.ndarray,
        y: np.ndarray,
        speed: np.ndarray,
        i: int,
        before: int | None,
        after: int | None,
        amplitude: float,
    ) -> _Turn:
        """Args: before, after: the maxima beside it; None at the ends of the recording."""
        last, top = len(t) - 1, None if before is None else len(t) - 1 - before
        leaves, goes_on = _leaves(t, y, speed, i, after, amplitude)
        reached, came = _leaves(t[::-1], y[::-1], -speed[::-1], last - i, top, amplitude)
        amid = (goes_on and leaves <= t[0]) or (came and reached >= t[last])
        closed = y[i] <= y.min() + _LOW * np.ptp(y)
        return cls(reached, leaves, (goes_on and came) or (closed and not amid), goes_on)


def _leaves(
    t: np.ndarray, y: np.ndarray, speed: np.ndarray, i: int, top: int | None, amplitude: float
) -> tuple[float, bool]:
    """When y leaves a minimum for the maximum after it, and whether it was seen to."""
    if top is None:
        top = i + int(np.argmax(y[i:]))
        if y[top] - y[i] < amplitude:
            return float(t[-1]), False
    j = i + int(np.argmax(y[i : top + 1] > y[i] + _LOW * (y[top] - y[i]))) - 1
    limit = _SLOW * speed[i : top + 1].max()
    while j > i and speed[j] > limit:
        j -= 1
    if speed[j] > limit or speed[j + 1] <= speed[j]:
        return float(t[j]), True
    share = np.clip((limit - speed[j]) / (speed[j + 1] - speed[j]), 0.0, 1.0)
    return float(t[j] + share * (t[j + 1] - t[j])), True


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


def _signal(
    by: str, solution: xr.Dataset, recording: Recording, axes: np.ndarray | None
) -> tuple[np.ndarray, str]:
    """What cycles are found by, at the solution's times, (N,), and its unit."""
    pose, t = solution["pose"].values, solution["time"].values
    points = solution.condyle.mechanism.platform.points
    incisal = PATHS if has_incisor(solution.condyle.mechanism) else ()
    if by in incisal:
        return way_of(points[POINT], pose, axes)[:, PATHS.index(by)], "m"
    if by in COORDINATES:
        return pose[:, COORDINATES.index(by)], "m" if by in "XYZ" else "rad"
    emg = solution["emg"].dropna("chain", how="all") if "emg" in solution else None
    chains = [] if emg is None else emg["chain"].values.tolist()
    if emg is not None and by.startswith(_EMG) and by[len(_EMG) :] in chains:
        return emg.sel(chain=by[len(_EMG) :]).values, "1"
    name, _, axis = by.rpartition(".")
    if name in points and axis in (*_AXES,):
        place = rotations(pose[:, 3:]) @ np.array(points[name]) + pose[:, :3]
        return place[:, _AXES.index(axis)], "m"
    try:
        label = find_label(by, recording.channels, recording.source, "channel")
    except InputError:
        known = [*COORDINATES, *incisal, *(f"{p}.{a}" for p in points for a in _AXES)]
        known += [*(_EMG + chain for chain in chains), *filter(None, recording.channels)]
        raise InputError(
            f'cycles: by: "{by}" is no coordinate, component of a landmark, EMG of a chain or '
            f"channel of {recording.source}.{did_you_mean(by, known)}"
        ) from None
    return np.interp(t, recording.t, recording.analog[:, label]), recording.channel_units[label]
