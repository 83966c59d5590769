"""The controller of a run, or of several in lockstep: the question `tick`, its ports filled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..graph.program import Numbers
from ..graph.transform import number_ports
from ..model.model import Model, model_for, model_with_inputs
from ..questions.law.controller import Reference
from ..questions.observer import ERROR, KALMAN, Measured
from ..questions.tick import REFERENCE, REQUEST, carried
from .columns import KernelColumns
from .plan import ClosedLoop, Plan
from .plant import WIDE, Plant

MEASURED = ("q", "q1", "joint", "joint_rate", "measured_force")  # results of a tick
SETTLING, SETTLED = 1000, 1e-6  # ticks at most, and relative change a tick, of a covariance
DIFFERENCE = 1e-6
NEVER = 1e9  # s
REPEATS = 4  # of the steps from encoders to a pose, before it is lost


class PoseLostError(Exception):
    """Forward kinematics of the encoders' counts did not converge from the last pose."""


def drive_of(plan: Plan) -> ClosedLoop:
    """The drive of a plan in closed loop."""
    assert isinstance(plan.drive, ClosedLoop)
    return plan.drive


class Controller:
    """Kernel, numbers and samples of controllers that are alike; in Python, of the first run.

    references: (K, numbers, runs) at the ticks, in the order of the ports.
    samples: (K, results, runs), the results of every tick;  states: (K, size, runs), its state.
    """

    references: np.ndarray
    samples: np.ndarray
    states: np.ndarray

    def __init__(self, plans: Sequence[Plan]) -> None:
        plan, drive = plans[0], drive_of(plans[0])
        sensing = drive.sensing
        self._inverse = drive.model.unchecked()
        models = [model_with_inputs(drive_of(p).model, plan.given) for p in plans]
        self._model, observer = models[0], None if sensing is None else sensing.observer
        # Ports of a tick -> results of the plant: encoders read joint + zero.
        joint = "joint" if sensing is None else "reading"
        self.measured: dict[str, str] = {"joint": joint}
        self.filters: bool = observer == KALMAN
        if not self.filters:
            motors = joint == "reading" and plan.drives is not None and plan.drives.side == "motor"
            rate = "reading_rate" if motors else "joint_rate"
            self.measured |= {"joint_rate": rate, "force": "measured_force"}
        self.details = (drive.law.table, drive.law.choices, observer, drive.limits)
        function = drive.law.table is None
        # Whether efforts are found in Python, and not by the kernel.
        chosen = drive.limits.chooses or not drive.model.chooses_efforts
        self.outside: bool = function or not chosen
        apart = self.outside and not function
        details = (*self.details, True) if apart else self.details
        self.columns: KernelColumns = KernelColumns.of(models, "tick", *details)
        self._apart = self.columns if self.outside else None
        self.ticks: np.ndarray = plan.ticks()
        rows = [self.columns.rows(name) for name in (*REFERENCE, *plan.given)]
        none = np.zeros(0, dtype=int)
        self._path = np.concatenate(rows)
        self.first: int = int(self._path.min())
        self._errors = none if sensing is None else self.columns.rows(ERROR)
        sizes = len(self._path) + len(self._errors), self.columns.results, plan.size
        self.references, self.samples, self.states = (
            np.zeros((len(self.ticks), size, self.columns.stride)) for size in sizes
        )
        self.carry: dict[str, str] = carried(
            [port.name for port in self.columns.kernel.interface.ports]
        )
        self.carry_to: np.ndarray = np.concatenate([none, *map(self.columns.rows, self.carry)])
        self.carry_from: np.ndarray = np.concatenate(
            [none, *map(self.columns.result, self.carry.values())]
        )
        self.fill(plans)

    def fill(self, plans: Sequence[Plan]) -> None:
        """Take the numbers of plans, but not their references."""
        self.plan: Plan = plans[0]
        self.drive: ClosedLoop = drive_of(plans[0])
        fill = self.columns.fill
        drives = [drive_of(plan) for plan in plans]
        for name in ("low", "high"):
            fill(name, np.clip([getattr(plan, name) for plan in plans], -WIDE, WIDE))
        for name in self.drive.law.numbers:
            fill(name, [drive.law.numbers[name] for drive in drives])
        for name in self.drive.numbers:
            fill(name, [drive.numbers[name] for drive in drives])
        fill("period", [self.drive.period or 1.0])
        if self.drive.sensing is not None:
            for name in self.drive.sensing.numbers:
                fill(name, [drive.sensing.numbers[name] for drive in drives])  # type: ignore[union-attr]

    def begin(self, plans: Sequence[Plan]) -> None:
        """Take references, and memory to begin with: a machine knows where it starts."""
        drives = [drive_of(plan) for plan in plans]
        starts = [i for i, drive in enumerate(drives)
                  if i == 0 or not drive.path.same_as(drives[i - 1].path)]  # fmt: skip
        for i, end in zip(starts, [*starts[1:], len(drives)], strict=True):
            if len(self.ticks):
                references = drives[i].path.at(self.ticks)
                self.references[:, self._path - self.first, i:end] = references[..., None]
        if self.drive.law.memory.size:
            self.columns.fill("memory_before", [drive.law.memory for drive in drives])
        if self.drive.sensing is None:
            return
        for i, drive in enumerate(drives):
            found = drive.sensing.errors(len(self.ticks))  # type: ignore[union-attr]
            self.references[:, self._errors - self.first, i] = found
        if self.filters:
            known = [np.concatenate([p.q, p.q1, np.zeros(3)]) for p in plans]
            self.columns.fill("estimate_before", known)
            for name in ("covariance_before", "begun_before"):
                self.columns.fill(name, [np.zeros(len(self.columns.rows(name)))])
            return
        at = np.array([plan.q for plan in plans]), np.array([plan.q1 for plan in plans])
        ports = dict(zip(("q", "q1"), at, strict=True))
        models = [drive.model for drive in drives], [plan.model for plan in plans]
        own, true = (_instants(each, ports) for each in models)
        joint = np.array([
            x if p.drives is None else p.drives.read(x)
            for p, x in zip(plans, true["joint"].T, strict=True)
        ])  # fmt: skip
        reading = joint + np.array([plan.model.mechanism.zeros for plan in plans])
        step = np.array([drive.sensing.numbers["resolution"] for drive in drives])  # type: ignore[union-attr]
        with np.errstate(divide="ignore", invalid="ignore"):
            counts = np.where(step > 0, step * np.round(reading / step), reading)
        counts = counts - np.array([drive.model.mechanism.zeros for drive in drives])
        self._remember(own["pose"].T, counts, own["joint_rate"].T)

    def _remember(self, pose: np.ndarray, joint: np.ndarray, rate: np.ndarray) -> None:
        """What an observer saw a period ago, the pose at rest; rows are runs."""
        fill, period = self.columns.fill, self.drive.period or 1.0
        fill("pose_before", pose)
        fill("pose_rate_before", np.zeros((1, 6)))
        fill("joint_before", joint - period * rate)
        fill("joint_rate_before", rate)

    def set_force(self, path_force: np.ndarray) -> None:
        """Set another force to follow, (K,) [N]."""
        self.references[:, self.columns.rows(REFERENCE[5])[0] - self.first, 0] = path_force

    def slopes(self, t: float) -> np.ndarray:
        """Efforts of a function in Python by the results `MEASURED`, where it was evaluated, as
        central differences, (n, numbers)."""
        columns = self.columns
        rows = np.concatenate([columns.result(name) for name in MEASURED])
        slopes = np.zeros((len(self.plan.low), len(rows)))
        for i, row in enumerate(rows):
            value = columns.found[row, 0]
            h = DIFFERENCE * max(1.0, abs(value))
            ends = []
            for end in (value - h, value + h):
                columns.found[row, 0] = end
                ends.append(self._given(t, columns))
            columns.found[row, 0] = value
            slopes[:, i] = (ends[1] - ends[0]) / (2 * h)
        return slopes

    # -- in Python ------------------------------------------------------------------------------

    def sample(self, t: float, y: np.ndarray, plant: Plant, k: int) -> np.ndarray:
        """Tick k, where the plant was evaluated; returns the efforts asked for.

        Raises: PoseLostError: where the encoders give no pose.
        """
        columns = self.columns
        given = self.references[k, :, 0]
        columns.given[self.first : self.first + len(given), 0] = given
        effort = self._solve(t, y, plant)
        self.samples[k, :, 0], self.states[k, :, 0] = columns.found[: columns.results, 0], y
        if np.isfinite(effort).all():
            columns.given[self.carry_to, 0] = columns.found[self.carry_from, 0]
        return effort

    def acting(self, k: int) -> np.ndarray:
        """Efforts within limits that act from tick k on, (n,): until the first efforts come, the
        drives hold what they will be."""
        due = max(k - self.drive.delay, 0)
        return self.samples[due, self.columns.result("effort"), 0]

    def at_once(self, t: float, y: np.ndarray, plant: Plant) -> np.ndarray:
        """Efforts of an ideal controller where the plant was evaluated, (n,)."""
        self.columns.given[self._path, 0] = self.drive.path.at(np.array([t]))[0]
        return self._solve(t, y, plant)

    def steadily(
        self, reference: np.ndarray, memory: np.ndarray, y: np.ndarray, plant: Plant
    ) -> np.ndarray:
        """Efforts asked for after a while of the same, where the plant was evaluated, (n,)."""
        columns = self.columns
        columns.given[self._path, 0] = reference
        if memory.size:
            columns.give("memory_before", memory)
        if columns.has("pose_before"):
            pose, reading, rate = (plant[name][None] for name in ("pose", "reading", "joint_rate"))
            self._remember(pose, reading - self._model.mechanism.zeros, rate)
        return self._settled(y, plant) if self.filters else self._solve(0.0, y, plant)

    def unloaded(self, memory: np.ndarray, y: np.ndarray, plant: Plant) -> np.ndarray:
        """Efforts asked for where it stands when the force of a law that holds one is yet to rise,
        the last of its memory, (n,)."""
        columns, rows = self.columns, self.columns.rows("rise")
        rise = columns.given[rows, 0].copy()
        columns.give("memory_before", [*memory[:-1], 0.0])
        columns.give("rise", NEVER)
        asked = self._solve(0.0, y, plant)
        columns.give("rise", rise)
        return asked

    def _settled(self, y: np.ndarray, plant: Plant) -> np.ndarray:
        """The same with a filter that has seen it for long: its covariance does not change, and the
        efforts that acted are those that it asks for."""
        columns, m = self.columns, len(self.plan.q)
        q, q1, force = y[:m], y[m : 2 * m], plant.columns.result("measured_force")
        load = plant.columns.found[force, 0] if force.size else np.zeros(3)
        period, rows = self.drive.period or 1.0, columns.rows("covariance_before")
        settled = columns.given[rows, 0].copy()
        for begun in (0.0, 1.0):  # first the efforts of the state and the load as they are
            columns.give("begun_before", begun)
            columns.give("covariance_before", begun * settled)
            columns.give("estimate_before", np.concatenate([q - begun * period * q1, q1, load]))
            plant.columns.give("effort", self._solve(0.0, y, plant))
        rows = np.concatenate([columns.rows("covariance_before"), columns.rows("acted")])
        for _ in range(SETTLING):
            effort = self._solve(0.0, y, plant)
            now, before = np.concatenate([columns["covariance"], effort]), columns.given[rows, 0]
            if (np.abs(now - before) <= SETTLED * np.abs(now)).all():
                break
            plant.columns.give("effort", effort)
            columns.give("covariance_before", columns["covariance"])
        return effort

    def _solve(self, t: float, y: np.ndarray, plant: Plant) -> np.ndarray:
        columns, m = self.columns, len(self.plan.q)
        for name, found in self.measured.items():
            if plant.columns.result(found).size:
                columns.give(name, plant[found])
        if self.filters:
            columns.give("acted", plant.columns.given[plant.columns.rows("effort"), 0])
        if columns.has("q"):
            columns.give("q", y[:m])
            columns.give("q1", y[m : 2 * m])
        if self.outside or columns.run():
            self._by_itself(t)
        return columns["asked"]

    def _by_itself(self, t: float) -> None:
        """Efforts that no kernel finds, or none that it can vouch for; poses by more steps."""
        if self._apart is None:
            self._apart = KernelColumns(self._model.kernel("tick", *self.details, True))
        columns, apart = self.columns, self._apart
        n = len(self.plan.low)
        for port in columns.kernel.interface.ports:
            if apart is not columns:
                apart.give(port.name, columns.given[columns.rows(port.name), 0])
        balances = apart.has("given")  # a law may ask for no inverse dynamics
        if balances:
            apart.give("given", np.zeros(n))
        repeats = REPEATS if apart.has("pose_before") else 1
        for _ in range(repeats):
            if sure := not apart.run():
                break
            if repeats > 1:
                period = apart.given[apart.rows("period"), 0]
                carried_on = period * apart.given[apart.rows("pose_rate_before"), 0]
                apart.give("pose_before", apart["pose"] - carried_on)
        if not sure and (repeats > 1 or self.filters):
            raise PoseLostError
        if balances:
            apart.give("given", self._given(t, apart))
            apart.run()
        for result in columns.kernel.interface.results:
            if apart is not columns:
                known = apart.result(result.name).size  # else of the limits, which start anew
                columns.found[columns.result(result.name), 0] = apart[result.name] if known else 0

    def _given(self, t: float, by: KernelColumns) -> np.ndarray:
        n, m = len(self.plan.low), len(self.plan.q)
        if self.drive.function is None:
            if not by.result(REQUEST).size:
                return np.zeros(n)
            q, q1, q2, force, point = np.split(by[REQUEST], [m, 2 * m, 3 * m, 3 * m + 3])
            wrench = np.concatenate([force, np.zeros(3)])
            if names := self.plan.given:
                around: Any = {name: by.given[by.rows(name), 0] for name in names}
                return self._model.inverse_dynamics(q, q1, q2, wrench, point, **around).effort
            answer: np.ndarray = self._inverse.inverse_dynamics(q, q1, q2, wrench, point)
            return answer
        measured = ("q", "q1", "joint", "joint_rate")
        now = Measured(**{name: by[name] for name in measured}, force=by["measured_force"], t=t)
        *path, force = (by.given[by.rows(name), 0] for name in REFERENCE)
        reference = Reference(*path, force=float(force[0]))  # type: ignore[misc]
        answer = self.drive.function(now, reference)  # type: ignore[misc]
        effort: np.ndarray = np.asarray(answer, dtype=float)
        if effort.shape != (n,) or not np.isfinite(effort).all():
            raise InputError(
                f"the controller returned {effort!s:.80} at t = {t:g} s; expected efforts of "
                f"shape ({n},), one a chain, finite"
            )
        return effort


def _instants(models: Sequence[Model], ports: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The question `instant` of a state of each model, which are alike."""
    systems = [model_for(model, len(models)).system for model in models]
    if all(system is systems[0] for system in systems):
        return systems[0].kernel("instant").run(ports).values
    numbers = number_ports(Numbers.joined([system.numbers for system in systems]))
    return systems[0].family.numberless("instant").run({**ports, **numbers}).values
