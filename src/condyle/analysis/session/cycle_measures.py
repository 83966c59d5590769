"""What a cycle came to, as a row; and cycles over normalised time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import trapezoid

from ...results.contacts import joint_loads
from ...results.emg_followed import emg_and_activation, emg_match
from .cycle_finding import PHASES, CycleDetection, at_times

if TYPE_CHECKING:
    import xarray as xr

SAMPLES = 101  # of normalised time, 0 to 1


def phase() -> np.ndarray:
    """Normalised time, (SAMPLES,): 0 where a cycle begins, 1 where it ends."""
    return np.linspace(0.0, 1.0, SAMPLES)


def measured_columns(solution: xr.Dataset) -> dict[str, np.ndarray]:
    """Samples that cycles are measured by, (N,) each [SI]: joint loads, positive where the surface
    pushes the ball; the size of the load, of efforts, and of joint loads of contacts without a
    side."""
    mechanism = solution.condyle.mechanism
    loads = joint_loads(mechanism, solution["contact_force"].values)
    found = {
        f"contact_{contact.name}": loads[:, i] if contact.side else np.abs(loads[:, i])
        for i, contact in enumerate(mechanism.contacts)
    }
    found["load"] = np.linalg.norm(solution["load"].values[:, :3], axis=1)
    effort = np.abs(solution["effort"].values)
    return found | {f"tau_{name}": effort[:, i] for i, name in enumerate(solution["chain"].values)}


def cycle_rows(solution: xr.Dataset, found: CycleDetection, by: str | None) -> list[dict[str, Any]]:
    """A row for each cycle of a trial.

    `start`, `duration` and its phases [s], `samples_without_result`, the range of the signal that
    cycles are found by, of each magnitude the peak, and the integral over time (`impulse`), and of
    each muscle with EMG the lag of its activation [s], and at that lag, or at none where that is
    None, root mean square difference and R^2, 0 where they oppose each other. Where a sample has no
    result, peaks, impulses and these are None.
    """
    t, status = solution["time"].values, solution["status"].values
    columns, muscles = measured_columns(solution), emg_and_activation(solution)
    values = np.column_stack([*columns.values()])
    rows, pairs = [], zip(found.spans, _samples(t, found.spans), strict=True)
    for k, ((start, end), samples) in enumerate(pairs, 1):
        inside = (t > start) & (t < end)
        failed = int((status[samples] != 0).sum())
        ends = at_times(t, values, np.array([start, end]))
        cut = np.vstack([ends[:1], values[inside], ends[1:]])
        times = np.concatenate([[start], t[inside], [end]])
        peaks, impulses = cut.max(axis=0), trapezoid(cut, times, axis=0)
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
        for name, (emg, activation) in muscles.items():
            match = None if failed else emg_match(t, emg, activation, start, end)
            row |= {
                f"emg_lag_{name}": match and match.lag,
                f"emg_rmse_{name}": match and match.rmse,
                f"emg_r2_{name}": match and max(match.correlation, 0.0) ** 2,
            }
        rows.append(row)
    return rows


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
    times = spans[:, :1] + phase() * np.diff(spans, axis=1)
    array = solution[variable]
    values = np.moveaxis(array.values, array.dims.index("time"), 0)
    return at_times(solution["time"].values, values, times)
