"""The controller of a run, or of several in lockstep: the question `tick`, its ports filled."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..questions.law.controller import Aim
from ..questions.observer import Seen
from ..questions.tick import AIMS, REQUEST, carried
from .columns import Columns
from .plan import ClosedLoop, Plan
from .plant import WIDE, Plant

REPEATS = 4  # of the steps from encoders to a pose, before it is lost


class Lost(Exception):
    """The encoders' counts give no pose near the last one."""


def drive_of(plan: Plan) -> ClosedLoop:
    """That of a plan in closed loop."""
    assert isinstance(plan.drive, ClosedLoop)
    return plan.drive


class Controller:
    """Kernel, numbers and looks of a plan's controller, or of several alike.

    aims:   (K, numbers, runs) at the ticks, in the order of the ports.
    looks:  (K, results, runs), what the tick found each time;  states: (K, size, runs), where.
    """

    def __init__(self, plan: Plan, runs: int = 1) -> None:
        drive = drive_of(plan)
        sensing = drive.sensing
        self._model, velocity = drive.model, None if sensing is None else sensing.velocity
        self.details = (drive.law.table, drive.law.choices, velocity)
        function = drive.law.table is None
        # Whether efforts are found in Python, and not by the kernel.
        self.outside = function or drive.model.chooses_efforts
        apart = self.outside and not function
        details = (*self.details, True) if apart else self.details
        self.columns = Columns(drive.model.kernel("tick", *details), runs)
        self._apart = self.columns if self.outside else None
        self.ticks = plan.ticks()
        rows = [self.columns.rows(name) for name in AIMS]
        self._aimed = np.concatenate(rows)
        self.first = int(self._aimed.min())
        sizes = len(self._aimed), self.columns.results, plan.size
        self.aims, self.looks, self.states = (
            np.zeros((len(self.ticks), size, self.columns.stride)) for size in sizes
        )
        self.carry = carried([port.name for port in self.columns.kernel.interface.ports])
        none = [np.zeros(0, dtype=int)]
        self.carry_to = np.concatenate(none + [self.columns.rows(to) for to in self.carry])
        found = [self.columns.result(name) for name in self.carry.values()]
        self.carry_from = np.concatenate(none + found)

    def fill(self, plan: Plan, run: int = 0) -> None:
        """Take the numbers of a plan for a run, but not its aims."""
        self.plan, self.drive, give = plan, drive_of(plan), self.columns.give
        drive = self.drive
        for name in ("low", "high"):
            give(name, np.clip(getattr(plan, name), -WIDE, WIDE), run)
        for name, value in drive.law.numbers.items():
            give(name, value, run)
        give("period", drive.period or 1.0, run)
        if drive.sensing is not None:
            give("resolution", drive.sensing.resolution, run)
            give("smoothing", drive.sensing.smoothing, run)

    def begin(self, plan: Plan, run: int = 0) -> None:
        """Aims, and memory to begin with: a machine knows where it starts."""
        drive, give = drive_of(plan), self.columns.give
        if len(self.ticks):
            self.aims[:, self._aimed - self.first, run] = drive.path.aims(self.ticks)
        if drive.law.memory.size:
            give("memory_before", drive.law.memory, run)
        if drive.sensing is None:
            return
        assert drive.period is not None
        at = drive.model.kernel("instant").run({"q": plan.q[None], "q1": plan.q1[None]}).values
        step, joint = drive.sensing.resolution, plan.model.kernel("instant")
        true = joint.run({"q": plan.q[None], "q1": plan.q1[None]}).values["joint"][:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            counts = np.where(step > 0, step * np.round(true / step), true)
        self._remember(at["pose"][:, 0], counts, at["joint_rate"][:, 0], run)

    def _remember(self, pose: np.ndarray, joint: np.ndarray, rate: np.ndarray, run: int) -> None:
        """What an observer saw a period ago, the pose at rest."""
        give, period = self.columns.give, self.drive.period or 1.0
        give("pose_before", pose, run)
        give("pose_rate_before", np.zeros(6), run)
        give("joint_before", joint - period * rate, run)
        give("joint_rate_before", rate, run)

    def aim_for(self, path_force: np.ndarray) -> None:
        """Another force to aim at, (K,) [N]."""
        self.aims[:, self.columns.rows(AIMS[5])[0] - self.first, 0] = path_force

    # -- in Python ------------------------------------------------------------------------------

    def look(self, t: float, y: np.ndarray, plant: Plant, k: int) -> np.ndarray:
        """Look at tick k, where the plant was looked at; returns the efforts asked for.

        Raises: Lost: where the encoders give no pose.
        """
        columns = self.columns
        columns.given[self.first : self.first + len(self._aimed), 0] = self.aims[k, :, 0]
        asked = self._solve(t, y, plant)
        self.looks[k, :, 0], self.states[k, :, 0] = columns.found[: columns.results, 0], y
        if np.isfinite(asked).all():
            columns.given[self.carry_to, 0] = columns.found[self.carry_from, 0]
        return asked

    def acting(self, k: int) -> np.ndarray:
        """Efforts within limits that act from tick k on, (n,): until the first efforts come, the
        drives hold what they will be."""
        due = max(k - self.drive.delay, 0)
        return self.looks[due, self.columns.result("effort"), 0]

    def at_once(self, t: float, y: np.ndarray, plant: Plant) -> np.ndarray:
        """Efforts of an ideal controller where the plant was looked at, (n,)."""
        self.columns.given[self._aimed, 0] = self.drive.path.aims(np.array([t]))[0]
        return self._solve(t, y, plant)

    def steadily(
        self, aim: np.ndarray, memory: np.ndarray, y: np.ndarray, plant: Plant
    ) -> np.ndarray:
        """Efforts asked for after a while of the same, where the plant was looked at, (n,)."""
        columns = self.columns
        columns.given[self._aimed, 0] = aim
        if memory.size:
            columns.give("memory_before", memory)
        if columns.has("pose_before"):
            self._remember(plant["pose"], plant["joint"], plant["joint_rate"], 0)
        return self._solve(0.0, y, plant)

    def _solve(self, t: float, y: np.ndarray, plant: Plant) -> np.ndarray:
        columns, m = self.columns, len(self.plan.q)
        for name in ("joint", "joint_rate"):
            columns.give(name, plant[name])
        if columns.has("q"):
            columns.give("q", y[:m])
            columns.give("q1", y[m : 2 * m])
        if plant.columns.result("felt").size:
            columns.give("force", plant["felt"])
        if self.outside or columns.run():
            self._by_itself(t)
        return columns["asked"]

    def _by_itself(self, t: float) -> None:
        """Efforts that no kernel finds, or none that it can vouch for; poses by more steps."""
        if self._apart is None:
            self._apart = Columns(self._model.kernel("tick", *self.details, True))
        columns, apart = self.columns, self._apart
        n = len(self.plan.low)
        for port in columns.kernel.interface.ports:
            if apart is not columns:
                apart.give(port.name, columns.given[columns.rows(port.name), 0])
        apart.give("given", np.zeros(n))
        repeats = REPEATS if apart.has("pose_before") else 1
        for _ in range(repeats):
            if sure := not apart.run():
                break
            if repeats > 1:
                period = apart.given[apart.rows("period"), 0]
                carried_on = period * apart.given[apart.rows("pose_rate_before"), 0]
                apart.give("pose_before", apart["pose"] - carried_on)
        if not sure and repeats > 1:
            raise Lost
        apart.give("given", self._given(t, apart))
        apart.run()
        for result in columns.kernel.interface.results:
            if apart is not columns:
                columns.found[columns.result(result.name), 0] = apart[result.name]

    def _given(self, t: float, seen: Columns) -> np.ndarray:
        n, m = len(self.plan.low), len(self.plan.q)
        if self.drive.function is None:
            if not seen.result(REQUEST).size:
                return np.zeros(n)
            q, q1, q2, force, point = np.split(seen[REQUEST], [m, 2 * m, 3 * m, 3 * m + 3])
            load = np.concatenate([force, np.zeros(3), point])
            return self._model.one(q, q1, q2, load)
        names = ("q", "q1", "joint", "joint_rate")
        now = Seen(**{name: seen[name] for name in names}, force=seen["felt"], t=t)
        *aim, force = (seen.given[seen.rows(name), 0] for name in AIMS)
        found = self.drive.function(now, Aim(*aim, force=float(force[0])))  # type: ignore[misc]
        effort: np.ndarray = np.asarray(found, dtype=float)
        if effort.shape != (n,) or not np.isfinite(effort).all():
            raise InputError(
                f"the controller returned {effort!s:.80} at t = {t:g} s; expected efforts of "
                f"shape ({n},), one a chain, finite"
            )
        return effort
