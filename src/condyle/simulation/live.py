"""A simulation to interact with: it goes on as time passes, parameters change, a hand pulls.

The hand is a spring with a damper between a point of the platform and where it is held,

    force = -stiffness (p - held) - damping p',

as three springs of one direction each. A controller does not measure it as a bite.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import UnsupportedError
from ..questions.load import ActingLoad
from ..questions.load.spring import Spring
from ..status import Status
from .events import Event
from .integrators import NoRateError
from .parameters import Parameter, parameters_of, with_values
from .plan import ClosedLoop, Plan
from .running import ROUNDING, Batch, RunEndedError

STEP = 2e-4  # seconds, in compiled code,
SLOW_STEP = 1e-3  # and in Python
HAND = "hand"


@dataclass(frozen=True)
class LiveState:
    """The mechanism at one time.

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

    Attributes: parameters, values: what can be changed, and the value of each;  pulling: whether
                a hand holds the platform;  ended: what ended it before its time.
    """

    def __init__(self, plan: Plan) -> None:
        """Raises: UnsupportedError: where contacts lift, or drives are not rigid."""
        if plan.sticking:
            raise UnsupportedError(
                "the live simulation has no static friction: remove static_coefficient of "
                "contacts, or run condyle simulate"
            )
        if plan.drives is not None:
            raise UnsupportedError(
                "the live simulation takes drives as rigid: remove [drives], or run condyle "
                "simulate"
            )
        if plan.freed is not None:
            raise UnsupportedError(
                "the live simulation keeps contacts, and [contacts] kind = "
                f'"{plan.scenario.contacts.kind}" lets them lift: remove it, or run condyle '
                "simulate"
            )
        if plan.method == "DOP853":
            plan = replace(plan, method="rk4", settings=replace(plan.settings, step=STEP))
            if Batch([replace(plan, times=np.zeros(0))]).steps is None:
                plan = replace(plan, settings=replace(plan.settings, step=SLOW_STEP))
        self.parameters: Sequence[Parameter] = parameters_of(plan)
        hand = _hand(np.zeros(3), np.zeros(3), 0.0, 0.0)
        self._plan = replace(
            plan,
            times=np.zeros(0),  # nothing is kept
            loads=plan.loads + hand,
            modes=(*plan.modes, *(0 for _ in hand)),
        )
        self._hand = hand
        self.values: list[float] = [parameter.value for parameter in self.parameters]
        self.duration: float = plan.duration
        self.restart()

    # -- time ---------------------------------------------------------------------------------

    def restart(self) -> None:
        """Begin again, with parameters and hand as they are."""
        self._now = self._held()
        self._run = Batch([self._now])
        self.ended: Event | None = None

    @property
    def t(self) -> float:
        """Where it is [s]."""
        return float(self._run.clock.t)

    @property
    def events(self) -> Sequence[Event]:
        """What has happened since the start."""
        return self._run.events

    @property
    def over(self) -> bool:
        """Whether it goes no further."""
        return self.ended is not None or self.t >= self.duration - ROUNDING

    def go_to(self, t: float) -> None:
        """Go on to a time [s], or to what ends the run before."""
        if self.over:
            return
        try:
            self._run.go_to(min(t, self.duration))
        except RunEndedError:
            self.ended = self._run.events[-1]

    # -- hands --------------------------------------------------------------------------------

    def set_parameter(self, number: int, value: float) -> None:
        """Set a parameter to a value, in SI."""
        self.values[number] = value
        self._change()

    def reset(self) -> None:
        """Set all parameters to their first values."""
        self.values = [parameter.value for parameter in self.parameters]
        self._change()

    def pull(self, point: np.ndarray, held: np.ndarray, stiffness: float, damping: float) -> None:
        """Hold a point (3,) [m] of {M} by a spring at (3,) [m] in {S}; N/m, N s/m."""
        self._hand = _hand(point, held - point, stiffness, damping)
        self._change()

    def let_go(self) -> None:
        """Take the hand away."""
        self._hand = _hand(self._hand[0].point, np.zeros(3), 0.0, 0.0)
        self._change()

    @property
    def pulling(self) -> bool:
        """Whether a hand holds it."""
        return bool(self._hand[0].numbers["stiffness"] > 0)

    def _held(self) -> Plan:
        changed = with_values(self._plan, self.parameters, self.values)
        return replace(changed, loads=changed.loads[: -len(self._hand)] + self._hand)

    def _change(self) -> None:
        self._now = self._held()
        if self.ended is None:
            self._run.change(self._now)

    # -- the state now ------------------------------------------------------------------------

    def state(self) -> LiveState:
        """The mechanism now.

        Raises: NoRateError: where it cannot be.
        """
        run, m, now = self._run, len(self._plan.q), self._now
        plant, effort = run.plant, np.full(len(now.low), np.nan)
        force = np.full(len(now.model.mechanism.contacts), np.nan)
        try:
            effort = run.acting(run.clock.t, run.state)
            force = plant["contact_force"]
        except NoRateError as error:
            if error.status == Status.unreachable:
                raise
        q, own = run.state[:m], len(now.loads) - len(self._hand)
        forces = plant["load_force"].reshape(-1, 3)
        off = bite = None
        if isinstance(now.drive, ClosedLoop):
            off = now.drive.path.states(np.array([run.clock.t]))[0][0] - q
            if now.drive.law.place is not None:
                measured = [load.place == now.drive.law.place for load in now.loads]
                bite = float(np.linalg.norm(forces[measured].sum(axis=0)))
        return LiveState(
            run.clock.t,
            q.copy(),
            plant["pose"],
            plant["joint"],
            plant["joint_rate"],
            effort,
            force,
            off,
            np.vstack([forces[:own], forces[own:].sum(axis=0)]),
            np.array([load.point for load in now.loads[: own + 1]]),
            bite,
        )


def _hand(
    point: np.ndarray, rest: np.ndarray, stiffness: float, damping: float
) -> tuple[ActingLoad, ...]:
    """Three springs at a point of {M}, each with its displacement of rest, (3,) [m]."""
    return tuple(
        ActingLoad(Spring, HAND, np.asarray(point), None, {
            "direction": axis, "stiffness": np.array(stiffness), "damping": np.array(damping),
            "rest": np.array(x),
        })
        for axis, x in zip(np.eye(3), rest, strict=True)
    )  # fmt: skip
