"""A solution to play back: which sample it is, and the snapshot there."""

from __future__ import annotations

import numpy as np
import xarray as xr

from ..kinematics.singularities import KINDS
from ..mechanism import Mechanism
from ..report.scene import place
from ..results.failed_samples import Failure, at_sample
from .snapshot import Level, Snapshot, state_messages


class Playback:
    """A solution with a clock.

    Attributes: index: the sample shown;  playing;  speed: times real time.
    """

    def __init__(self, solution: xr.Dataset) -> None:
        self.solution = solution
        self.mechanism: Mechanism = solution.condyle.mechanism
        self.time: np.ndarray = solution["time"].values
        self.index: int = 0
        self.playing: bool = False
        self.speed: float = 1.0
        self._clock = 0.0
        self._good = np.flatnonzero(solution["status"].values == 0)
        self._failures = solution.condyle.failures
        names = ("pose", "joint", "joint_rate", "effort", "contact_force", "bound_margin", "load")
        self._values = {name: solution[name].values for name in names}

    @property
    def now(self) -> float:
        """Time of the sample shown [s]."""
        return float(self.time[self.index])

    def seek(self, time: float) -> None:
        """Show the sample nearest to `time` [s]."""
        after = int(np.searchsorted(self.time, time))
        near = [i for i in (after - 1, after) if 0 <= i < len(self.time)]
        self.index = min(near, key=lambda i: abs(self.time[i] - time))
        self._clock = self.now

    def play(self) -> None:
        """Go on from here, from the start at the end."""
        if self.index == len(self.time) - 1:
            self.index = 0
        self._clock = self.now
        self.playing = True

    def pause(self) -> None:
        self.playing = False

    def advance(self, seconds: float) -> bool:
        """Let `seconds` of real time pass; returns whether another sample is shown."""
        if not self.playing:
            return False
        before = self.index
        clock = self._clock + seconds * self.speed
        self.seek(clock)
        self._clock = clock  # the sample's own time would lose what is between samples
        if clock >= self.time[-1]:
            self.index, self.playing = len(self.time) - 1, False
        return self.index != before

    def path(self, point: tuple[float, ...]) -> np.ndarray:
        """Where a point of the platform, (3,) in {M}, goes: (N, 3) [m], good samples only."""
        pose = self._values["pose"]
        good = np.isfinite(pose).all(axis=1)
        return place(self.mechanism, pose[good], self._values["joint"][good]).on_platform(point)

    def snapshot(self) -> Snapshot:
        """The mechanism at the sample shown; without a result, where it was last, and no forces."""
        i, s = self.index, self.solution
        failed = at_sample(self._failures, i)
        drawn = i if failed is None else self._good_before(i)
        here = {name: values[i] for name, values in self._values.items()}
        pose, joint = self._values["pose"][drawn], self._values["joint"][drawn]
        pose = np.nan_to_num(pose)  # home, where there is not one good sample
        points = self.mechanism.platform.points
        at = points.get(s.condyle.options["load_point"] or "", (0.0, 0.0, 0.0))
        load = here["load"][:3] if failed is None else np.full(3, np.nan)
        level, messages = self._messages(failed, drawn, here)
        return Snapshot.at(
            self.mechanism,
            pose,
            np.nan_to_num(joint),
            joint=here["joint"],
            rate=here["joint_rate"],
            effort=here["effort"],
            contact_force=here["contact_force"],
            margin=here["bound_margin"],
            load=load,
            load_at=np.array(at),
            ratio=float(s["singularity_ratio"].values[i]),
            condition=float(s["condition"].values[i]),
            near=KINDS[int(s["singularity"].values[i])],
            level=level,
            messages=messages,
            time=self.now,
            stale=failed is not None,
            markers=s["marker_place"].values[i] if "marker_place" in s else None,
        )

    def _good_before(self, sample: int) -> int:
        """The nearest sample with a result: before, else after, else the sample itself."""
        if not self._good.size:
            return sample
        return int(self._good[max(int(np.searchsorted(self._good, sample)) - 1, 0)])

    def _messages(
        self, failed: Failure | None, drawn: int, here: dict[str, np.ndarray]
    ) -> tuple[Level, tuple[str, ...]]:
        if failed is not None:
            return "unreachable", (
                f"No result from {failed.start:g} to {failed.end:g} s: {failed.text}",
                f"Grey: the mechanism at t = {self.time[drawn]:g} s, without forces",
            )
        margin, force = here["bound_margin"], here["contact_force"]
        messages = state_messages(self.mechanism, margin, force, here["effort"], here["joint_rate"])
        return ("warning" if messages else "ok"), tuple(messages)
