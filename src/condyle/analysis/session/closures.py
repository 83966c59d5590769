"""Whether the closed jaw stays where it is: a splint that slips moves all closures after it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .cycle_finding import CycleDetection, at_times

if TYPE_CHECKING:
    import xarray as xr

_LARGE, _CLEAR = 1.5e-3, 3.0  # m, and a multiple of the scatter, from which a step is a slip


@dataclass(frozen=True)
class ClosureStep:
    """The largest step between the mean places of closures before a time and after it.

    Attributes: size: of the middle of the platform's markers in {S} [m];  time: of the first
                closure after it [s];  scatter: of closures about the mean of their side, root mean
                square [m].
    """

    size: float
    time: float
    scatter: float

    @property
    def large(self) -> bool:
        """Whether it is no scatter of closures."""
        return self.size > max(_LARGE, _CLEAR * self.scatter)

    def __str__(self) -> str:
        return (
            f"from {self.time:.4g} s on the closed jaw is {self.size * 1e3:.3g} mm from where it "
            f"was (closures scatter by {self.scatter * 1e3:.2g} mm): did markers slip on the teeth?"
        )


def closure_step(solution: xr.Dataset, cycles: CycleDetection) -> ClosureStep | None:
    """The largest step of measured markers between closures, at the ends of cycles.

    None where fewer than two cycles have been found.
    """
    if cycles.phases is None or len(cycles.spans) < 2 or "marker_place" not in solution:
        return None
    start, end = cycles.spans.T
    times = np.unique(np.concatenate([start, end - cycles.phases[:, 2]]))
    lower = solution["marker_body"].values == "platform"
    place = solution["marker_place"].values[:, lower]
    there = at_times(solution["time"].values, place, times)
    seen = np.isfinite(there).all(axis=(0, 2))
    if not seen.any():
        return None
    middle = there[:, seen].mean(axis=1)
    steps, scatter = [], []
    for k in range(2, len(times) - 1):
        sides = middle[:k], middle[k:]
        steps.append(np.linalg.norm(sides[1].mean(axis=0) - sides[0].mean(axis=0)))
        off = np.concatenate([side - side.mean(axis=0) for side in sides])
        scatter.append(np.sqrt((off**2).sum(axis=1).mean()))
    if not steps:
        return None
    k = int(np.argmin(scatter))
    return ClosureStep(float(steps[k]), float(times[k + 2]), float(scatter[k]))
