"""What actuators are asked for, as figures and page show it: duty, limits as a box, activation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..mechanism.chain import limits
from .words import stem

if TYPE_CHECKING:
    from ..mechanism.actuator import Limits
    from ..results.solution import Solution

REACH = 2.5  # a limit beyond this many times the data would flatten them

Edge = tuple[list[float], list[float]]


@dataclass(frozen=True)
class Duty:
    """One actuator along a run; samples without a result do not count.

    effort, speed: (N,) [N m or N; rad/s or m/s].   time: (N,) [s].   unit: of the effort.
    """

    effort: np.ndarray
    speed: np.ndarray
    time: np.ndarray
    unit: str

    @property
    def power(self) -> np.ndarray:
        """Delivered at the joint, (N,) [W]; negative where the actuator brakes."""
        return self.effort * self.speed

    @property
    def rms(self) -> float:
        """Root of the mean square of the effort over time, which heats a motor; NaN without any."""
        good = np.isfinite(self.effort)
        if good.sum() < 2:
            return abs(float(self.effort[good][0])) if good.any() else np.nan
        # Spans of time between two good samples only: a gap has no effort.
        square, step = self.effort**2, np.diff(self.time)
        both = good[1:] & good[:-1]
        if not both.any():
            return float(np.sqrt(square[good].mean()))
        mean = 0.5 * (square[1:] + square[:-1])[both] @ step[both] / step[both].sum()
        return float(np.sqrt(mean))

    @property
    def peak_power(self) -> float:
        """Largest of |power| [W]; NaN where there is none."""
        power = np.abs(self.power[np.isfinite(self.power)])
        return float(power.max()) if power.size else np.nan

    @property
    def text(self) -> str:
        """'rms 0.21 N m, 0.5 W'."""
        if np.isnan(self.rms):
            return "no result"
        return f"rms {self.rms:.3g} {self.unit}, {self.peak_power:.3g} W"


def duty(solution: Solution) -> list[Duty]:
    """Of every chain, in their order."""
    effort, speed = solution["torque"].values, solution["joint_rate"].values
    time, units = solution["time"].values, solution["effort_unit"].values
    return [Duty(effort[:, i], speed[:, i], time, str(u)) for i, u in enumerate(units)]


def edges(box: Limits, speed: float, effort: float) -> list[Edge]:
    """The sides of the box of limits as lines (speeds, efforts), as far as they are near the data.

    Args: speed, effort: largest of |data|. A side further out than `REACH` times these would
          flatten the data and is left out; the others end where the data do.
    """
    near_speed, near_effort = REACH * (speed or np.inf), REACH * (effort or np.inf)
    wide = box.speed if box.speed <= near_speed else speed
    low = box.low if -box.low <= near_effort else -effort
    high = box.high if box.high <= near_effort else effort
    found: list[Edge] = []
    if high == box.high and np.isfinite(high):
        found.append(([-wide, wide], [high, high]))
    if low == box.low and np.isfinite(low):
        found.append(([-wide, wide], [low, low]))
    if wide == box.speed and np.isfinite(wide):
        found += [([side, side], [low, high]) for side in (-wide, wide)]
    return [edge for edge in found if np.isfinite(edge).all()]


def limits_text(box: Limits, effort_unit: str, speed_unit: str) -> str:
    """'0 to 66.9 N, 0.5 m/s'; empty where there is no limit."""
    speed = f"{box.speed:g} {speed_unit}" if np.isfinite(box.speed) else ""
    return ", ".join(text for text in (box.effort_text(effort_unit), speed) if text)


def activations(solution: Solution) -> dict[str, np.ndarray]:
    """Chain -> |effort| over its greatest effort, (N,), of chains that have one.

    A left and a right one stand together, in the order of the mechanism.
    """
    chains = solution.mechanism.chains
    stems = list(dict.fromkeys(stem(chain.name) for chain in chains))
    order = sorted(range(len(chains)), key=lambda i: stems.index(stem(chains[i].name)))
    effort = solution["torque"].values
    found = {}
    for i in order:
        greatest = limits(chains[i]).greatest
        if np.isfinite(greatest) and greatest > 0:
            found[chains[i].name] = np.abs(effort[:, i]) / greatest
    return found


def joint_loads(solution: Solution) -> dict[str, np.ndarray]:
    """Contact -> force between ball and surface, (N,) [N]; negative where it would have to pull."""
    force = solution["contact_force"].values
    found = {}
    for i, contact in enumerate(solution.mechanism.contacts):
        one = force[:, i]
        found[contact.name] = contact.push * one if contact.one_sided else np.abs(one)
    return found
