"""What actuators are asked for, as figures and page show it: duty, limits as a box, activation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..mechanism.chain import limits
from .naming import stem

if TYPE_CHECKING:
    import xarray as xr

    from ..mechanism.actuator import Limits

EMG_ROW = " EMG"  # after a chain's name, where its measured activity has a row
REACH = 2.5  # a limit beyond this many times the data would flatten them

Edge = tuple[list[float], list[float]]


@dataclass(frozen=True)
class Duty:
    """What one actuator does along a run; samples without a result do not count.

    rms: root of the mean square of the effort over time, which heats a motor [N m or N].
    power: largest of |effort times speed| [W].   unit: of the effort.   NaN: no result at all.
    """

    rms: float
    power: float
    unit: str

    @property
    def text(self) -> str:
        """'rms 0.21 N m, 0.5 W'."""
        if np.isnan(self.rms):
            return "no result"
        return f"rms {self.rms:.3g} {self.unit}, {self.power:.3g} W"


class DutyMeter:
    """Takes up a run piece by piece.

    Between two samples the square of an effort is a straight line; spans that touch a sample
    without a result are left out.
    """

    def __init__(self) -> None:
        self._squares: np.ndarray | float = 0.0
        self._spans: np.ndarray | float = 0.0
        self._power: np.ndarray | float = -np.inf
        self._last: xr.Dataset | None = None
        self._units: list[str] = []

    def see(self, piece: xr.Dataset) -> None:
        """Take up the next piece of the run."""
        effort, speed = piece["effort"].values, piece["joint_rate"].values
        time = piece["time"].values
        self._units = [str(unit) for unit in piece["effort_unit"].values]
        power = np.abs(effort * speed)
        self._power = np.fmax(self._power, np.fmax.reduce(power, axis=0, initial=-np.inf))
        if self._last is not None:
            effort = np.vstack([self._last["effort"].values, effort])
            time = np.append(self._last["time"].values, time)
        square, step = effort**2, np.diff(time)[:, None]
        pairs = 0.5 * (square[1:] + square[:-1])
        good = np.isfinite(pairs)
        self._squares = self._squares + (np.where(good, pairs, 0.0) * step).sum(axis=0)
        self._spans = self._spans + (good * step).sum(axis=0)
        self._last = piece.isel(time=slice(-1, None))

    def read(self) -> list[Duty]:
        """The duty of every chain, in their order."""
        with np.errstate(invalid="ignore", divide="ignore"):
            rms = np.sqrt(np.asarray(self._squares) / self._spans)
        power = np.where(np.isfinite(self._power), self._power, np.nan)
        return [
            Duty(float(a), float(b), u) for a, b, u in zip(rms, power, self._units, strict=True)
        ]


def duty(solution: xr.Dataset) -> list[Duty]:
    """The duty of every chain, in their order."""
    meter = DutyMeter()
    meter.see(solution)
    return meter.read()


def edges(box: Limits, speed: float, effort: float) -> list[Edge]:
    """The sides of the box of limits as lines (speeds, efforts), as far as they are near the data.

    Args: speed, effort: largest of |data|. A side further out than `REACH` times these would
          flatten the data and is left out; the others end where the data do.
    """
    near_speed, near_effort = REACH * (speed or np.inf), REACH * (effort or np.inf)
    fastest = box.speed if box.speed <= near_speed else speed
    low = box.low if -box.low <= near_effort else -effort
    high = box.high if box.high <= near_effort else effort
    lines: list[Edge] = []
    if high == box.high and np.isfinite(high):
        lines.append(([-fastest, fastest], [high, high]))
    if low == box.low and np.isfinite(low):
        lines.append(([-fastest, fastest], [low, low]))
    if fastest == box.speed and np.isfinite(fastest):
        lines += [([side, side], [low, high]) for side in (-fastest, fastest)]
    return [edge for edge in lines if np.isfinite(edge).all()]


def drawn_limits(solution: xr.Dataset, variable: str) -> list[Limits]:
    """Limits of each chain's torque or force, or of its speed, as those of an effort."""
    found = [limits(chain) for chain in solution.condyle.mechanism.chains]
    return found if variable == "effort" else [one.of_speed for one in found]


def limits_text(box: Limits, effort_unit: str, speed_unit: str) -> str:
    """'0 to 66.9 N, 0.5 m/s'; empty where there is no limit."""
    speed = f"{box.speed:g} {speed_unit}" if np.isfinite(box.speed) else ""
    return ", ".join(text for text in (box.effort_text(effort_unit), speed) if text)


def activations(solution: xr.Dataset) -> dict[str, np.ndarray]:
    """Chain -> |effort| over its greatest effort, (N,), of chains that have one.

    A left and a right one stand together, in the order of the mechanism.
    """
    chains = solution.condyle.mechanism.chains
    stems = list(dict.fromkeys(stem(chain.name) for chain in chains))
    order = sorted(range(len(chains)), key=lambda i: stems.index(stem(chains[i].name)))
    effort = solution["effort"].values
    by_chain = {}
    for i in order:
        greatest = limits(chains[i]).greatest
        if chains[i].kind == "muscle":
            by_chain[chains[i].name] = solution["activation"].values[:, i]
        elif np.isfinite(greatest) and greatest > 0:
            by_chain[chains[i].name] = np.abs(effort[:, i]) / greatest
    return by_chain


def emg(solution: xr.Dataset) -> dict[str, np.ndarray]:
    """Chain -> envelope of its EMG, (N,), of chains that have some; measured, not computed."""
    if "emg" not in solution:
        return {}
    names, values = solution["chain"].values, solution["emg"].values
    return {
        str(name): values[:, i] for i, name in enumerate(names) if np.isfinite(values[:, i]).any()
    }
