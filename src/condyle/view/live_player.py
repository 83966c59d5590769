"""A simulation to watch while it runs: it keeps pace with the clock as well as it can."""

from __future__ import annotations

import time

import numpy as np

from ..mechanism import Mechanism
from ..report.scene import place
from ..results.contacts import bound_margins
from ..simulation.integrators import NoRateError
from ..simulation.live import Live, LiveState
from ..simulation.plan import Plan
from .session import load_points, place_of
from .snapshot import Level, Snapshot, measured, state_messages

SLICE = 2e-3  # seconds of the simulation between two looks at the clock
BUDGET = 0.04  # seconds of work between two pictures
LONGEST = 0.1  # seconds: a longer time between two pictures is not made up for
BEHIND = 0.9  # of the speed that was asked for, below which the page says so
SMOOTHING = 0.8  # of the pace, from picture to picture
HAND = 1000.0  # 1/s^2: stiffness of the hand, of the platform's mass


class LivePlayer:
    """A simulation with a clock; of the same use to the page as a `Playback`.

    Attributes: playing;  speed: times real time;  again: whether it begins again at its end;
                stiffness: of the hand [N/m];  pull_at: name of the point that it holds, of
                `pull_points`.   independent, load_names: names of q and of the scenario's loads.
                state: the last that could be evaluated.
    """

    pull_points: tuple[str, ...]
    pull_at: str

    def __init__(self, plan: Plan) -> None:
        self.mechanism: Mechanism = plan.model.mechanism
        self._model = plan.model
        self.live: Live = Live(plan)
        self.playing: bool = True
        self.speed: float = 1.0
        self.loop: bool = True
        self.stiffness: float = HAND * self.mechanism.platform.mass
        self.independent: tuple[str, ...] = tuple(plan.model.independent)
        self.load_names: tuple[str, ...] = tuple(load.name for load in plan.loads)
        self.pull_points, self.pull_at = load_points(self.mechanism)
        self._pace, self._clock = 1.0, 0.0
        self.state: LiveState = self.live.state()

    @property
    def now(self) -> float:
        """Time of the simulation [s]."""
        return self.live.t

    def play(self) -> None:
        """Go on; from the start where it is over."""
        if self.live.over:
            self.restart()
        self.playing = True

    def pause(self) -> None:
        self.playing = False

    def restart(self) -> None:
        """Start again, with sliders as they are."""
        self.live.restart()
        self._clock = 0.0

    def advance(self, seconds: float) -> bool:
        """Let `seconds` of real time pass; returns whether anything moved."""
        if not self.playing or seconds <= 0:
            return False
        seconds = min(seconds, LONGEST)
        begun, late = self.live.t, time.perf_counter() + BUDGET
        self._clock += seconds * self.speed
        self.playing = False  # a law that fails is reported once
        while not self.live.over and self.live.t < self._clock and time.perf_counter() < late:
            self.live.go_to(min(self.live.t + SLICE, self._clock))
        self.playing = True
        if not self.live.over:
            pace = (self.live.t - begun) / (seconds * self.speed)
            self._pace = SMOOTHING * self._pace + (1 - SMOOTHING) * pace
            self._clock = min(self._clock, self.live.t + SLICE)  # what was lost is not made up for
        elif self.loop and self.live.ended is None:
            self.restart()
        else:
            self.playing = False
        return True

    def pull(self, held: np.ndarray) -> None:
        """Hold the point `pull_at` by a spring at (3,) [m] in {S}, critically damped."""
        damping = 2 * float(np.sqrt(self.stiffness * self.mechanism.platform.mass))
        self.live.pull(self._pulled(), held, self.stiffness, damping)

    def let_go(self) -> None:
        """Take the hand away."""
        self.live.let_go()

    def grip(self) -> np.ndarray:
        """Where the point `pull_at` is, (3,) [m] in {S}."""
        scene = place(self.mechanism, self.state.pose[None], self.state.joint[None])
        return np.array(scene.on_platform(tuple(self._pulled()))).ravel()

    def _pulled(self) -> np.ndarray:
        return place_of(self.mechanism, self.pull_at)

    def snapshot(self) -> Snapshot:
        """The mechanism now, or where it could be seen last."""
        stale = False
        try:
            self.state = self.live.state()
        except NoRateError:
            stale = True
        now = self.state
        configuration = self._model.poses.configuration(now.pose[None])
        margin = bound_margins(self.mechanism, configuration.contact_point)[0]
        level, messages = self._messages(now, margin)
        return Snapshot.at(
            self.mechanism,
            now.pose,
            now.joint,
            joint=now.joint,
            rate=now.joint_rate,
            effort=now.effort,
            contact_force=now.contact_force,
            margin=margin,
            load=np.zeros(3),
            load_at=np.zeros(3),
            level=level,
            messages=messages,
            time=self.live.t,
            stale=stale,
            pushes=now.forces,
            pushes_at=now.points,
            **measured(configuration.singularity),
        )

    def _messages(self, now: LiveState, margin: np.ndarray) -> tuple[Level, tuple[str, ...]]:
        state = state_messages(
            self.mechanism, margin, now.contact_force, now.effort, now.joint_rate
        )
        if (end := self.live.ended) is not None:
            whose = f" ({end.owner})" if end.owner else ""
            return "unreachable", (f"Simulation ended: {end.text}{whose}", *state)
        notes: list[str] = []
        if self.live.over:
            notes.append("Simulation finished.")
        if self.playing and self._pace < BEHIND:
            notes.append(f"Slower than requested: {self._pace * self.speed:.2g} times real time")
        return ("warning" if state else "ok"), (*notes, *state)
