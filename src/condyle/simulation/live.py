"""A simulation under a hand: it goes on as time passes, knobs turn, and the hand pulls.

The hand is a spring with a damper between a point of the platform and where it is held,

    force = -stiffness (p - held) - damping p',

as three springs of one direction each. A controller does not feel it as a bite.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from .events import Event
from .integrators import Stuck
from .knobs import Knob, at, knobs_of
from .loads.spring import BoundSpring
from .plan import ClosedLoop, Plan
from .plant import Plant
from .run import ROUNDING, Ended, Run

STEP = 2e-4  # seconds, in compiled code,
SLOW_STEP = 1e-3  # and in Python
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
HAND = "hand"


@dataclass(frozen=True)
class Moment:
    """What is where at one time.

    pose: X_EE (6,);  joint, joint_rate, effort: (n,);  contact_force: (k,) [N], NaN where there is
    none;  error: reference less q, (m,), or None without a controller.
    forces: of the loads, (loads, 3) [N] in {S};  points: where they act, (loads, 3) in {M}; the
    hand's is the last.
    bite: force of the loads along the controller's measured point [N], or None.
    """

    t: float
    q: np.ndarray
    pose: np.ndarray
    joint: np.ndarray
    joint_rate: np.ndarray
    effort: np.ndarray
    contact_force: np.ndarray
    error: np.ndarray | None
    forces: np.ndarray
    points: np.ndarray
    bite: float | None


class Live:
    """A plan, run bit by bit, with fixed steps unless it asks for an implicit method.

    Attributes: knobs, values: what can be turned, and where each stands;  pulling: whether a hand
                holds the platform.
    """

    def __init__(self, plan: Plan) -> None:
        if plan.method == "DOP853":
            plan = replace(plan, method="rk4", settings=replace(plan.settings, step=STEP))
            if Run(replace(plan, times=np.zeros(0))).quick() is None:
                plan = replace(plan, settings=replace(plan.settings, step=SLOW_STEP))
        self.knobs: Sequence[Knob] = knobs_of(plan)
        hand = tuple(BoundSpring(HAND, np.zeros(3), direction=u) for u in AXES)
        self._plan = replace(
            plan,
            times=np.zeros(0),  # nothing is kept
            loads=plan.loads + hand,
            modes=(*plan.modes, *(0 for _ in hand)),
        )
        self._turned, self._hand = self._plan, hand
        self._plant = Plant(plan.model, self._plan.loads)
        self.values = [knob.value for knob in self.knobs]
        self.duration = plan.duration
        self.restart()

    # -- time ---------------------------------------------------------------------------------

    def restart(self) -> None:
        """From the start, with knobs and hand as they are."""
        self._now = self._held()
        self._run = Run(self._now)
        self._quick = self._run.quick()
        self._ended: Event | None = None

    @property
    def t(self) -> float:
        """Where it is [s]."""
        return self._run.t

    @property
    def events(self) -> Sequence[Event]:
        """What has happened since the start."""
        return self._run.events

    @property
    def ended(self) -> Event | None:
        """What ended it before its time."""
        return self._ended

    @property
    def over(self) -> bool:
        """Whether it goes no further."""
        return self._ended is not None or self.t >= self.duration - ROUNDING

    def go_to(self, t: float) -> None:
        """Go on to a time [s], or to what ends the run before."""
        if self.over:
            return
        try:
            self._run.go_to(min(t, self.duration), self._quick)
        except Ended:
            self._ended = self._run.events[-1]

    # -- hands --------------------------------------------------------------------------------

    def turn(self, number: int, value: float) -> None:
        """Put a knob to a value, in SI."""
        self.values[number] = value
        self._turn()

    def reset(self) -> None:
        """All knobs as they were to begin with."""
        self.values = [knob.value for knob in self.knobs]
        self._turn()

    def pull(self, point: np.ndarray, held: np.ndarray, stiffness: float, damping: float) -> None:
        """Hold a point (3,) [m] of {M} by a spring at (3,) [m] in {S}; N/m, N s/m."""
        self._hand = tuple(
            replace(
                spring, point=point, rest=float(held[i] - point[i]),
                stiffness=stiffness, damping=damping,
            )
            for i, spring in enumerate(self._hand)
        )  # fmt: skip
        self._change()

    def let_go(self) -> None:
        """Take the hand away."""
        self._hand = tuple(replace(s, stiffness=0.0, damping=0.0) for s in self._hand)
        self._change()

    @property
    def pulling(self) -> bool:
        """Whether a hand holds it."""
        return self._hand[0].stiffness > 0

    def _turn(self) -> None:
        self._turned = at(self._plan, self.knobs, self.values)
        self._change()

    def _held(self) -> Plan:
        own = len(self._plan.loads) - len(self._hand)
        return replace(self._turned, loads=self._turned.loads[:own] + self._hand)

    def _change(self) -> None:
        self._now = self._held()
        self._plant.loads = self._now.loads
        if self._ended is None:
            self._run.change(self._now.drive, self._now.loads)
            if self._quick is not None:
                self._quick.change(self._now.drive, self._now.loads)

    # -- what is seen -------------------------------------------------------------------------

    def moment(self) -> Moment:
        """The mechanism now.

        Raises: Stuck: where it cannot be.
        """
        run, plant, m, now = self._run, self._plant, len(self._plan.q), self._now
        t, y, modes = run.t, run.y, run.modes
        q, q1 = y[:m], y[m : 2 * m]
        wrench = plant.state(t, y, modes)
        seen = plant.last
        effort = np.full(len(now.low), np.nan)
        force = np.full(len(now.model.mechanism.contacts), np.nan)
        with suppress(Stuck):
            effort = run.effort()
            force = plant.accelerate(q, q1, effort, wrench)[1].copy()
        places = zip(now.loads, modes, plant.places(), strict=True)
        forces = np.array([load.law(t, s, v, int(mode))[:3] for load, mode, (s, v, _) in places])
        own = len(now.loads) - len(self._hand)
        error = bite = None
        if isinstance(now.drive, ClosedLoop):
            error = now.drive.path.states(np.array([t]))[0][0] - q
            if now.drive.law.place is not None:
                bite = float(np.linalg.norm(plant.force_at(now.drive.law.place, t, modes)))
        return Moment(
            t,
            q.copy(),
            seen["pose"].copy(),
            seen["joint"].copy(),
            seen["joint_rate"].copy(),
            effort,
            force,
            error,
            np.vstack([forces[:own], forces[own:].sum(axis=0)]),
            np.array([load.point for load in now.loads[: own + 1]]),
            bite,
        )
