"""What a cycle came to, as a row; and cycles over normalised time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import trapezoid

from ...results.contacts import joint_loads
from ...results.emg_followed import emg_and_activation, emg_match
from ..sweep.bands import quantiles
from .cycle_finding import PHASES, CycleDetection, at_times

if TYPE_CHECKING:
    import xarray as xr

    from ...mechanism.mechanism import Mechanism
    from ..sweep.bands import VariantResults

SAMPLES = 101  # of normalised time, 0 to 1


def phase() -> np.ndarray:
    """Normalised time, (SAMPLES,): 0 where a cycle begins, 1 where it ends."""
    return np.linspace(0.0, 1.0, SAMPLES)


def measured_columns(solution: xr.Dataset) -> dict[str, np.ndarray]:
    """Samples that cycles are measured by, (N,) each [SI]: joint loads, positive where the surface
    pushes the ball; the size of the load, of efforts, and of joint loads of contacts without a
    side."""
    loads = _loads(solution.condyle.mechanism, solution["contact_force"].values)
    found = {f"contact_{name}": loads[:, i] for i, name in enumerate(solution["contact"].values)}
    found["load"] = np.linalg.norm(solution["load"].values[:, :3], axis=1)
    effort = np.abs(solution["effort"].values)
    return found | {f"tau_{name}": effort[:, i] for i, name in enumerate(solution["chain"].values)}


def _loads(mechanism: Mechanism, force: np.ndarray) -> np.ndarray:
    """Joint loads (..., k), of a contact without a side their size."""
    loads = joint_loads(mechanism, force)
    sized = np.array([not contact.side for contact in mechanism.contacts], dtype=bool)
    return np.where(sized, np.abs(loads), loads)


def cycle_rows(
    solution: xr.Dataset, cycles: CycleDetection, by: str | None
) -> list[dict[str, Any]]:
    """A row for each cycle of a trial.

    `start`, `duration` and its phases [s], `samples_without_result`, the range of the signal that
    cycles are found by, of each magnitude the peak, and the integral over time (`impulse`), and of
    each muscle with EMG the lag of its activation [s], and at that lag, or at none where that is
    None, root mean square difference and R^2, 0 where they oppose each other. Where a sample has no
    result, peaks, impulses and these are None.
    """
    t, status = solution["time"].values, solution["status"].values
    columns, muscles = measured_columns(solution), emg_and_activation(solution)
    measures = peaks_and_impulses(t, np.column_stack([*columns.values()]), cycles.spans)
    rows, samples_of = [], _samples(t, cycles.spans)
    for k, ((start, end), samples, peaks, impulses) in enumerate(
        zip(cycles.spans, samples_of, *measures, strict=True), 1
    ):
        inside = (t > start) & (t < end)
        failed = int((status[samples] != 0).sum())
        row: dict[str, Any] = {
            "cycle": k, "start": float(start), "duration": float(end - start),
            "samples_without_result": failed,
        }  # fmt: skip
        if cycles.phases is not None:
            row |= {p: _known(s) for p, s in zip(PHASES, cycles.phases[k - 1], strict=True)}
        if by is not None:
            row[f"range_{by}"] = float(np.ptp(cycles.signal[inside])) if inside.any() else 0.0
        for name, peak, impulse in zip(columns, peaks, impulses, strict=True):
            row |= {f"peak_{name}": _known(peak), f"impulse_{name}": _known(impulse)}
        for name, (emg, activation) in muscles.items():
            match = None if failed else emg_match(t, emg, activation, start, end)
            row |= {
                f"emg_lag_{name}": match and match.lag,
                f"emg_rmse_{name}": match and match.rmse,
                f"emg_r2_{name}": match and max(match.correlation, 0.0) ** 2,
            }
        rows.append(row)
    return rows


def peaks_and_impulses(
    t: np.ndarray, values: np.ndarray, spans: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Largest values of magnitudes (N, ...) in each cycle, and integrals over time, (C, ...)."""
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
    loads = _loads(solution.condyle.mechanism, variants.values["contact_force"])
    efforts = np.abs(variants.values["effort"])
    columns = {}
    for dimension, column, values in (("contact", "contact", loads), ("chain", "tau", efforts)):
        sizes = values.transpose(1, 2, 0)  # (N, ..., V)
        measures = peaks_and_impulses(solution["time"].values, sizes, spans)
        for word, measure in zip(("peak", "impulse"), measures, strict=True):
            for i, name in enumerate(solution[dimension].values):
                columns[f"{word}_{column}_{name}"] = measure[:, i].T
    return columns


def band_columns(measures: Mapping[str, np.ndarray]) -> list[dict[str, float | None]]:
    """Outer quantiles over variants of measures (V, C), a row a cycle: `<measure>_low`, `_high`."""
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
