"""When and why a run has no result, as figures, page and live view say it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

MOST = 500


@dataclass(frozen=True)
class Gap:
    """Samples in a row without a result.

    first, last: their numbers;  start, end: their times [s];  status: its word;  cause: or "".
    """

    first: int
    last: int
    start: float
    end: float
    status: str
    cause: str

    def __str__(self) -> str:
        return f"{self.status}: {self.cause}" if self.cause else self.status


def gaps(
    solution: xr.Dataset, time: np.ndarray | None = None, status: np.ndarray | None = None
) -> list[Gap]:
    """Runs of failed samples, in the order of time.

    Args: time, status: of the whole run, (N,), where the solution has fewer samples.
    """
    time = solution["time"].values if time is None else time
    status = solution["status"].values if status is None else status
    words = solution["status"].attrs["flag_meanings"].split()
    known = solution.condyle.failures
    found = []
    for first, after in pairwise(np.flatnonzero(np.diff(status, prepend=0, append=0))):
        if status[first] == 0:
            continue
        start, end = float(time[first]), float(time[after - 1])
        causes = [one.cause for one in known if one.cause and one.start <= end and start <= one.end]
        why = "; ".join(dict.fromkeys(causes))
        found.append(Gap(int(first), int(after) - 1, start, end, words[int(status[first])], why))
    return found


def longest(found: list[Gap], most: int = MOST) -> list[Gap]:
    """The longest ones, in the order of time: more could not be told apart on a screen."""
    kept = sorted(found, key=lambda one: one.start - one.end)[:most]
    return sorted(kept, key=lambda one: one.first)


def at_sample(found: list[Gap], sample: int) -> Gap | None:
    """The gap that a sample is in, or None."""
    return next((one for one in found if one.first <= sample <= one.last), None)
