"""Which contacts lift in a run: how often, how long, when, where, and how fast they land."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr


@dataclass
class ContactLift:
    """How a contact was open.

    count: how often;  open: how long in all [s];  first, last: the first and the last instant [s].
    landing_speed: the largest along the normal at a landing [m/s]; None where none is known.
    """

    count: int = 0
    open: float = 0.0
    first: float = 0.0
    last: float = 0.0
    landing_speed: float | None = None

    def add(self, start: float, end: float) -> None:
        """Add an interval [s]."""
        self.first = self.first if self.count else start
        self.count, self.open, self.last = self.count + 1, self.open + end - start, end

    def land(self, speed: float) -> None:
        """Add a landing [m/s]."""
        self.landing_speed = max(speed, self.landing_speed or 0.0)


def contact_lifts(solution: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Contacts that lift in a solution, by name: `ContactLift` and `point`, the ball's centre
    where it lifts first (3,) [m].

    Simulations record every instant; of efforts that release contacts the samples say.
    """
    if "contact_active" not in solution:
        return {}
    time, names = solution["time"].values, [str(name) for name in solution["contact"].values]
    if "contact_lifts" in solution.attrs:
        found = json.loads(solution.attrs["contact_lifts"])
    else:
        is_open = (
            ~solution["contact_active"].values.astype(bool)
            & (solution["status"].values == 0)[:, None]
        )
        lifts = {name: _of_samples(time, is_open[:, i]) for i, name in enumerate(names)}
        found = {name: asdict(lift) for name, lift in lifts.items() if lift.count}
    found = {name: found[name] for name in names if name in found}
    for name, lift in found.items():
        k = min(int(np.searchsorted(time, lift["first"])), len(time) - 1)
        lift["point"] = solution["contact_point"].values[k, names.index(name)].tolist()
    return found


def _of_samples(time: np.ndarray, is_open: np.ndarray) -> ContactLift:
    lift = ContactLift()
    edges = np.flatnonzero(np.diff(is_open, prepend=False, append=False))
    for start, end in edges.reshape(-1, 2).tolist():
        lift.add(float(time[start]), float(time[end - 1]))
    return lift
