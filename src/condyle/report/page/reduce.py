"""A run of any length as what a screen can show, in flat memory.

The solution is read in pieces. The page gets samples at even steps, with every curve's largest and
smallest among them, and of each curve the largest and smallest value of each of `BUCKETS` spans of
time. So no peak is lost, in the plots or in the tables.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..actuators import Duty, DutyMeter, duty
from ..panel import panels_of
from .page_columns import Envelope

if TYPE_CHECKING:
    import xarray as xr

    from ...results.failed_samples import Failure

BUDGET = 3_400_000  # bytes of samples, so that a page of 5001 samples stays under 10 MB
BUCKETS = 1200  # of an envelope: two of them a pixel of a wide plot
DRAWN = (4, 3, 20)  # columns a chain, a marker, and besides, that the picture in space needs
PIECE = 32_768  # samples that are looked at together


@dataclass(frozen=True)
class ReducedSolution:
    """A solution with the samples that a page keeps.

    solution: with `samples` (K,) of the run's `total`;  envelope: of its curves, or None if the
    page has every sample.   status, time: of every sample, (N,), [s];  failures: of all;  near:
    number of samples near a singularity.   duties: of each actuator, of every sample too.
    """

    solution: xr.Dataset
    samples: np.ndarray
    envelope: Envelope | None
    status: np.ndarray
    time: np.ndarray
    failures: list[Failure]
    near: int
    duties: list[Duty]

    @property
    def total(self) -> int:
        return len(self.time)

    @property
    def failed(self) -> int:
        return int((self.status != 0).sum())


def reduced(solution: xr.Dataset) -> ReducedSolution:
    """The solution as a page can carry it; one in a file is read piece by piece."""
    time, status = solution["time"].values, solution["status"].values
    failed = solution.condyle.failures
    count = len(time)
    lines = curve_values(solution.isel(time=slice(0, 2)).load())
    counts = solution.sizes["chain"], solution.sizes.get("marker", 0), 1
    columns = len(lines) + sum(n * count for n, count in zip(DRAWN, counts, strict=True))
    affordable = max(BUDGET // (4 * max(columns, 1)), 2)
    if count <= affordable:
        whole = solution.load()
        near = int((whole["singularity"].values != 0).sum())
        return ReducedSolution(
            whole, np.arange(count), None, status, time, failed, near, duty(whole)
        )
    # An envelope takes 12 bytes a curve and span, a sample 4 bytes a column.
    # It gets half of the room at most, so that the samples still draw tracks and planes.
    buckets = min(BUCKETS, affordable * columns // (6 * len(lines)))
    spare = affordable - 3 * buckets * len(lines) // columns
    starts = np.linspace(0, count, buckets + 1).astype(int)
    envelope = Envelope(np.append(time[starts[:-1]], time[-1]))
    extremes, near, meter = {0, count - 1}, 0, DutyMeter()
    for first, last in pieces(starts):
        piece = solution.isel(time=slice(starts[first], starts[last])).load()
        near += int((piece["singularity"].values != 0).sum())
        meter.see(piece)
        for name, values in curve_values(piece).items():
            spans = envelope.spans.setdefault(name, np.array(4 * [np.full(buckets, np.nan)]))
            spans[:, first:last] = _extremes(values, np.diff(starts[first : last + 1]))
    length = np.maximum(np.diff(envelope.edges), 1e-300)
    for spans in envelope.spans.values():
        at = starts[:-1] + np.nan_to_num(spans[2:]).astype(int)
        for best, values, sample in zip((np.nanargmin, np.nanargmax), spans[:2], at, strict=True):
            if np.isfinite(values).any():
                extremes.add(int(sample[best(values)]))
        spans[2:] = np.clip((time[at] - envelope.edges[:-1]) / length, 0.0, 1.0)
    extremes |= set(_edges(status).tolist())
    steps = np.linspace(0, count - 1, max(spare - len(extremes), 2)).astype(int)
    samples = np.unique([*steps, *extremes])
    return ReducedSolution(
        _at(solution, samples), samples, envelope, status, time, failed, near, meter.read()
    )


def curve_values(solution: xr.Dataset) -> dict[str, np.ndarray]:
    """What every panel of the page draws, (N,) by name of its column."""
    by_column: dict[str, np.ndarray] = {}
    for _, panel in panels_of(solution, every=True):
        for curve in panel.curves:
            by_column[curve.column] = curve.values
            if curve.across is not None:
                by_column[curve.across[0]] = curve.across[1]
    return by_column


def pieces(starts: np.ndarray) -> Iterator[tuple[int, int]]:
    """Runs of whole spans, (first, last), of `PIECE` samples or one span."""
    first, last = 0, len(starts) - 1
    while first < last:
        end = int(np.searchsorted(starts, starts[first] + PIECE, side="right")) - 1
        end = min(max(end, first + 1), last)
        yield first, end
        first = end


def _extremes(values: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Least and greatest value of each span of samples, and their indices in it, (4, B)."""
    inside = np.arange(size.max()) < size[:, None]
    padded = np.full(inside.shape, np.nan)
    padded[inside] = values
    at = [
        np.argmin(np.where(np.isnan(padded), np.inf, padded), axis=1),
        np.argmax(np.where(np.isnan(padded), -np.inf, padded), axis=1),
    ]
    return np.array([*(padded[np.arange(len(k)), k] for k in at), *at])


def _edges(status: np.ndarray, most: int = 200) -> np.ndarray:
    """Samples on both sides of a change of status; a limited number of changes."""
    change = np.flatnonzero(np.diff(status))[:most]
    return np.concatenate([change, change + 1])


def _at(solution: xr.Dataset, samples: np.ndarray) -> xr.Dataset:
    """The solution at these samples; read in slices, since single rows of a file are slow."""
    import xarray as xr

    parts = []
    for start in range(0, solution.sizes["time"], PIECE):
        chosen = samples[(samples >= start) & (samples < start + PIECE)] - start
        piece = solution.isel(time=slice(start, start + PIECE))
        parts.append(piece.isel(time=chosen).load())
    fixed = [name for name in solution.data_vars if "time" not in solution[name].dims]
    joined = xr.concat(
        [p.drop_vars(fixed) for p in parts], "time", coords="minimal", compat="override"
    )
    joined = joined.assign({name: solution[name] for name in fixed})
    return joined.assign_attrs(solution.attrs)
