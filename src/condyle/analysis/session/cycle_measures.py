"""What a cycle came to, as a row; and cycles over normalised time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import trapezoid

from ..sweep.bands import quantiles
from .cycle_finding import PHASES, CycleDetection, at_times

if TYPE_CHECKING:
    import xarray as xr

    from ..sweep.bands import VariantResults

SAMPLES = 101  # of normalised time, 0 to 1


def phase() -> np.ndarray:
    """Normalised time, (SAMPLES,): 0 where a cycle begins, 1 where it ends."""
    return np.linspace(0.0, 1.0, SAMPLES)


def measured_columns(solution: xr.Dataset) -> dict[str, np.ndarray]:
    """Magnitudes that cycles are measured by, (N,) each: joint loads, the load, efforts [SI]."""
    found = {
        f"contact_{name}": np.abs(solution["contact_force"].values[:, i])
        for i, name in enumerate(solution["contact"].values)
    }
    found["load"] = np.linalg.norm(solution["load"].values[:, :3], axis=1)
    effort = np.abs(solution["effort"].values)
    return found | {f"tau_{name}": effort[:, i] for i, name in enumerate(solution["chain"].values)}


def cycle_rows(solution: xr.Dataset, found: CycleDetection, by: str | None) -> list[dict[str, Any]]:
    """A row for each cycle of a trial.

    `start`, `duration` and its phases [s], `samples_without_result`, the range of the signal that
    cycles are found by, and of each magnitude the peak, and the integral over time (`impulse`).
    Where a sample has no result, peaks and impulses are None.
    """
    t, status = solution["time"].values, solution["status"].values
    columns = measured_columns(solution)
    measures = peaks_and_impulses(t, np.column_stack([*columns.values()]), found.spans)
    rows, samples_of = [], _samples(t, found.spans)
    for k, ((start, end), samples, peaks, impulses) in enumerate(
        zip(found.spans, samples_of, *measures, strict=True), 1
    ):
        inside = (t > start) & (t < end)
        failed = int((status[samples] != 0).sum())
        row: dict[str, Any] = {
            "cycle": k, "start": float(start), "duration": float(end - start),
            "samples_without_result": failed,
        }  # fmt: skip
        if found.phases is not None:
            row |= {p: _known(s) for p, s in zip(PHASES, found.phases[k - 1], strict=True)}
        if by is not None:
            row[f"range_{by}"] = float(np.ptp(found.signal[inside])) if inside.any() else 0.0
        for name, peak, impulse in zip(columns, peaks, impulses, strict=True):
            row |= {f"peak_{name}": _known(peak), f"impulse_{name}": _known(impulse)}
        rows.append(row)
    return rows


def peaks_and_impulses(
    t: np.ndarray, values: np.ndarray, spans: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Of magnitudes (N, ...) in each cycle the largest, and the integral over time, (C, ...)."""
    peaks, impulses = [], []
    for start, end in spans:
        inside = (t > start) & (t < end)
        ends = at_times(t, values, np.array([start, end]))
        cut = np.concatenate([ends[:1], values[inside], ends[1:]])
        peaks.append(cut.max(axis=0))
        impulses.append(trapezoid(cut, np.concatenate([[start], t[inside], [end]]), axis=0))
    shape = len(spans), *values.shape[1:]
    return np.array(peaks).reshape(shape), np.array(impulses).reshape(shape)


def variant_measures(
    solution: xr.Dataset, variants: VariantResults, spans: np.ndarray
) -> dict[str, np.ndarray]:
    """Peaks and impulses of joint loads and efforts in each cycle, by column, (V, C)."""
    found = {}
    for dimension, column, values in (
        ("contact", "contact", variants.contact_force),
        ("chain", "tau", variants.effort),
    ):
        sizes = np.abs(values).transpose(1, 2, 0)  # (N, ..., V)
        measures = peaks_and_impulses(solution["time"].values, sizes, spans)
        for word, measure in zip(("peak", "impulse"), measures, strict=True):
            for i, name in enumerate(solution[dimension].values):
                found[f"{word}_{column}_{name}"] = measure[:, i].T
    return found


def band_columns(measures: Mapping[str, np.ndarray]) -> list[dict[str, float | None]]:
    """By cycle the outer quantiles over variants of measures (V, C): `<measure>_low`, `_high`."""
    columns: dict[str, np.ndarray] = {}
    for name, values in measures.items():
        low, *_, high = quantiles(values)
        columns |= {f"{name}_low": low, f"{name}_high": high}
    return [
        {name: _known(value) for name, value in zip(columns, row, strict=True)}
        for row in zip(*columns.values(), strict=True)
    ]


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def complete_spans(solution: xr.Dataset, spans: np.ndarray) -> np.ndarray:
    """Cycles all of whose samples have a result."""
    status = solution["status"].values
    samples = _samples(solution["time"].values, spans)
    return spans[np.array([not status[of].any() for of in samples], dtype=bool)]


def _samples(t: np.ndarray, spans: np.ndarray) -> list[slice]:
    """The samples of each cycle; its ends lie between two of them, and both count."""
    first = np.clip(np.searchsorted(t, spans[:, 0], side="right") - 1, 0, None)
    last = np.clip(np.searchsorted(t, spans[:, 1]), None, len(t) - 1)
    return [slice(a, b + 1) for a, b in zip(first, last, strict=True)]


def normalised(solution: xr.Dataset, spans: np.ndarray, variable: str) -> np.ndarray:
    """A variable over the normalised time of cycles, (C, SAMPLES, ...)."""
    array = solution[variable]
    values = np.moveaxis(array.values, array.dims.index("time"), 0)
    return over_cycles(solution["time"].values, values, spans)


def over_cycles(t: np.ndarray, values: np.ndarray, spans: np.ndarray) -> np.ndarray:
    """Samples (N, ...) over the normalised time of cycles, (C, SAMPLES, ...)."""
    return at_times(t, values, spans[:, :1] + phase() * np.diff(spans, axis=1))
