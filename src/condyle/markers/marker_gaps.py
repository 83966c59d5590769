"""Gaps: frames without a pose. Short ones are filled and listed, long ones are no motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import InputError
from ..motion.arrays import runs_of
from ..motion.path import MIN_ROWS
from ..motion.spline import Spline

Keep = Literal["one", "longest", "all"]
"""Of gaps too long to fill: an error, or keep the longest interval, or all long enough ones."""

_SLACK = 1e-6  # of a frame
_SHORTEST = 0.5  # s, of an interval that is kept between gaps
_NAMED = 5  # gaps that an error names
_DEGREE = 3


@dataclass(frozen=True)
class Gap:
    """Frames without a pose of their own.

    Attributes: start, end: times of the first and the last [s];  frames: number of frames.
                reason: why;  made: "filled" by the spline, or "cut" off the motion's ends.
    """

    start: float
    end: float
    frames: int
    reason: str
    made: Literal["filled", "cut"]

    def __str__(self) -> str:
        frames = "1 frame" if self.frames == 1 else f"{self.frames} frames"
        return f"{self.start:.4g} to {self.end:.4g} s ({frames}, {self.made}): {self.reason}"


def close_gaps(
    source: str,
    t: np.ndarray,
    values: np.ndarray,
    longest_gap: float,
    keep: Keep,
    why: Callable[[slice], str],
    trim: float = 0.0,
) -> tuple[list[tuple[slice, np.ndarray]], list[Gap]]:
    """Intervals of frames to keep with their values without gaps, and the gaps.

    Args:   t: (F,) [s], evenly spaced;  values: (F, m), NaN where there is none.
            longest_gap: to fill [s]. Frames missing at the ends are cut off, since nothing stands
                beyond them; a longer gap there is an error like any other.
            keep: what becomes of gaps that are longer.
            why: the reason of a run of missing frames.
            trim: time that is taken off both ends of an interval later [s].
    Raises: InputError: for gaps that are longer, or for too few frames.
    """
    step = (t[-1] - t[0]) / max(len(t) - 1, 1)
    missing = ~np.isfinite(values).all(axis=1)
    runs = runs_of(missing)
    too_long = [r for r in runs if (r.stop - r.start) * step > longest_gap + _SLACK * step]
    if too_long and keep == "one":
        told = [f"{t[r.start]:.4g} to {t[r.stop - 1]:.4g} s ({why(r)})" for r in too_long[:_NAMED]]
        more = f" and {len(too_long) - _NAMED} more" if len(too_long) > _NAMED else ""
        raise InputError(
            f"{source}: no pose for longer than {longest_gap:g} s: {'; '.join(told)}{more}.",
            "Repair the recording, allow longer gaps with --max-gap, or keep the longest gap-free "
            "interval with --longest",
        )
    ends = [0, *(end for r in too_long for end in (r.start, r.stop)), len(t)]
    between = [_trimmed(slice(*pair), missing) for pair in zip(ends[::2], ends[1::2], strict=True)]
    intervals = [max(between, key=lambda s: s.stop - s.start)]
    if keep == "all":
        intervals = [s for s in between if (s.stop - s.start) * step >= _SHORTEST] or intervals
    intervals = [s for s in intervals if (~missing[s]).sum() >= MIN_ROWS]
    left = [s for s in intervals if s.stop - s.start - 2 * trim / step >= MIN_ROWS]
    if intervals and not left:
        longest = max(s.stop - s.start for s in intervals) * step
        raise InputError(
            f"{source}: lasts {longest:.4g} s without a gap, and {trim:.3g} s are taken off both "
            "ends, where filters are least accurate; nothing is left",
            "Record longer, or keep the ends: trim = 0 under [filter]",
        )
    intervals = left
    if not intervals:
        reason = f": {why(runs[0])}" if runs else ""
        most = max(int((~missing[s]).sum()) for s in between)
        raise InputError(
            f"{source}: {most} frames have a pose, expected at least {MIN_ROWS}{reason}"
        )
    gaps = []
    for r in runs:
        inside = any(s.start <= r.start and r.stop <= s.stop for s in intervals)
        ends_at = float(t[r.start]), float(t[r.stop - 1])
        gaps.append(Gap(*ends_at, r.stop - r.start, why(r), "filled" if inside else "cut"))
    return [(s, filled(t[s], values[s])) for s in intervals], gaps


def _trimmed(frames: slice, missing: np.ndarray) -> slice:
    """Without the frames that are missing at its ends."""
    held = np.flatnonzero(~missing[frames])
    if not len(held):
        return slice(frames.start, frames.start)
    return slice(frames.start + int(held[0]), frames.start + int(held[-1]) + 1)


def filled(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The values with a cubic spline through those there are where some are missing."""
    known = np.isfinite(values).all(axis=1)
    if known.all():
        return values
    spline = Spline.through(t[known] - t[0], values[known], _DEGREE)
    return np.where(known[:, None], values, spline(t - t[0]))
