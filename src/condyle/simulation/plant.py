"""The plant of a run, or of several in lockstep: the question `rate`, its ports filled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..backends.kernel import AGAIN, shapes_of
from ..errors import InputError
from ..kinematics.chain import FAMILIES
from ..model.model import model_with_inputs
from ..questions.drive import BY_STATE
from ..questions.excitation import muscle_numbers
from ..questions.load.acting import WRENCH
from ..status import Status
from .columns import KernelColumns
from .compliant import INDENTED, ContactLaws
from .events import KINDS
from .integrators import NoRateError
from .plan import LAGS, ClosedLoop, OpenLoop, Plan

WIDE = 1e100  # stands for no limit: products with it stay finite
CERTAIN = 0.5  # of a placement


# Of a contact's bounds, in the order of the question `rate`.
FACES = tuple(f"its {end} {axis}" for end in ("least", "greatest") for axis in "xyz")


@dataclass(frozen=True)
class Guard:
    """What stays below zero, and what its passing zero means.

    row: of the rate's results;  load, mode: which load takes which mode, or None.
    flank: whether it ends what gears bear by, which is no event.
    contact: of contacts that lift and land, or stick, or of rotors that grip, which one, or None.
    """

    row: int
    kind: str
    text: str
    owner: str
    ends: bool = False
    load: int | None = None
    mode: int = 0
    contact: int | None = None
    flank: bool = False


@dataclass(frozen=True)
class Fed:
    """A table over time that feeds a port, linear between its rows.

    times: (N,) [s];  rows: (N, numbers, runs);  vanishes: whether it is zero outside.
    """

    port: str
    times: np.ndarray
    rows: np.ndarray
    vanishes: bool

    def at(self, t: float | np.ndarray) -> np.ndarray:
        """The first run's row at a time [s], or its rows at several."""
        ends = {"left": 0.0, "right": 0.0} if self.vanishes else {}
        return np.array([np.interp(t, self.times, one, **ends) for one in self.rows[..., 0].T]).T


class Plant:
    """Kernel and numbers of plans that are alike; in Python the first of them has its states."""

    def __init__(self, plans: Sequence[Plan]) -> None:
        plan = plans[0]
        models = [model_with_inputs(p.model, plan.given) for p in plans]
        self._model, machine = models[0], plan.model.mechanism
        contacts = machine.contacts
        self._bounded = [i for i, c in enumerate(contacts) if any(c.bounds.entries().values())]
        self._sided = [i for i, c in enumerate(contacts) if c.one_sided]
        self._push = np.array([contacts[i].push for i in self._sided], dtype=float)
        measured: list[int] = []
        if isinstance(plan.drive, ClosedLoop) and (place := plan.drive.law.place) is not None:
            measured = [i for i, load in enumerate(plan.loads) if load.place == place]
        laws = tuple(load.law for load in plan.loads)
        self.details: tuple[Any, ...] = (
            laws, tuple(measured), tuple(self._bounded), tuple(self._sided)
        )  # fmt: skip
        if plan.lifting is not None:
            self.details += (plan.lifting.forms,)
            self.details += (True,) if plan.lifting.compliant else ()
        if plan.drives is not None:
            lifting = plan.lifting
            freed = ((), False) if lifting is None else (lifting.forms, lifting.compliant)
            self.details = (*self.details[:4], *freed, plan.drives.side)
        if plan.sticking:
            self.details = (*(*self.details, (), False, "")[:7], plan.sticking)
        if plan.gripping:
            self.details = (*self.details, (), True)
        self.columns: KernelColumns = KernelColumns.of(models, "rate", *self.details)
        # Where what lags is in the state, and in the results its rate, by port.
        self.lags: dict[str, np.ndarray] = {
            port: self.columns.result(LAGS[port]) for port in plan.lags
        }
        self.fill(plans)

    def fill(self, plans: Sequence[Plan]) -> None:
        """Take the numbers of plans."""
        self.plan: Plan = plans[0]
        fill = self.columns.fill
        self.tables: list[Fed] = fed(plans)
        self.laws: ContactLaws | None = None
        for name in ("low", "high", "speed"):
            fill(name, np.clip([getattr(plan, name) for plan in plans], -WIDE, WIDE))
        if "activation" in self.lags:
            fill("muscle", [muscle_numbers(p.model.mechanism.chains) for p in plans])
            fill("excited", [isinstance(p.drive, OpenLoop) and p.drive.excited for p in plans])
        if self.plan.sticking:
            contacts = self.plan.model.mechanism.contacts
            frictions = [contacts[i].friction for i in self.plan.sticking]
            fill("static_coefficient", [[one.static_coefficient for one in frictions]])
        if self.plan.drives is not None:
            fill("drive", [p.drives.numbers for p in plans if p.drives is not None])
            self.set_flanks(None)
        if self.plan.gripping:
            fill("static_friction", [p.drives.static for p in plans if p.drives is not None])
        if self._bounded:
            fill("bounds", [bounds(plan, self._bounded) for plan in plans])
        if self._sided:
            fill("push", [self._push])
        if self.plan.lifting is not None:
            for name, value in self.plan.lifting.ports().items():
                fill(name, [value])
            self.laws = ContactLaws(self.plan.lifting) if self.plan.lifting.compliant else None
        for i, load in enumerate(plans[0].loads):
            fill(f"load_{i}_point", [plan.loads[i].point for plan in plans])
            for name in load.numbers:
                fill(f"load_{i}_{name}", [plan.loads[i].numbers[name] for plan in plans])

    def set_modes(self, modes: Any) -> None:
        """Set the modes of the loads, (loads,) or (loads, runs), and of contacts that lift."""
        count = len(self.plan.loads)
        for i, mode in enumerate(modes[:count]):
            self.columns.fill(f"load_{i}_mode", np.atleast_1d(mode))
        if self.plan.lifting is not None:
            self.columns.fill("active", np.reshape(modes[count:], (1, -1)))
        if self.plan.sticking:
            self.columns.fill("stuck", np.reshape(modes[count:], (1, -1)))
        if self.plan.gripping:
            self.columns.fill("grips", self._by_chain(np.reshape(modes[count:], (1, -1))))

    def set_flanks(self, apart: np.ndarray | None) -> None:
        """Set the flanks that bear where rotors and joints are so far apart, (n,), up to the next
        event; None: as each state says."""
        flank = np.full(len(self.plan.low), BY_STATE)
        if apart is not None and self.plan.drives is not None:
            play = self.plan.drives.half_play
            side = np.where(np.abs(apart) > play, np.sign(apart), 0.0)
            flank = np.where(play > 0, side, BY_STATE)
        self.columns.fill("flank", [flank])

    def _by_chain(self, values: np.ndarray) -> np.ndarray:
        """Values of chains whose rotors have static friction, (N, g), as those of all, (N, n)."""
        found = np.zeros((len(values), len(self.plan.low)))
        found[:, list(self.plan.gripping)] = values
        return found

    def guards(self, plan: Plan) -> list[Guard]:
        """Bounds, pulls of unilateral contacts, speeds; then the loads' own."""
        machine, rows = plan.model.mechanism, iter(self.columns.result("guards").tolist())
        names = machine.contact_names
        guards = [
            Guard(next(rows), "bound", f"{KINDS['bound']}, {face}", names[i], plan.stop_at_bounds)
            for i in self._bounded
            for face in FACES
        ]
        guards += [
            Guard(next(rows), "contact_loss", KINDS["contact_loss"], names[i], True)
            for i in self._sided
        ]
        for i in np.flatnonzero(np.isfinite(plan.speed)).tolist():
            chain, row = machine.chains[i], int(self.columns.result("too_fast")[i])
            unit = FAMILIES[chain.kind].joint_unit
            text = f"faster than its limit of {plan.speed[i]:g} {unit}/s"
            guards.append(Guard(row, "speed", text, chain.name))
        for i in [] if plan.drives is None else plan.drives.limited.tolist():
            row, text = int(self.columns.result("excess")[i]), KINDS["current"]
            guards.append(Guard(row, "current", text, machine.chains[i].name))
        for number, load in enumerate(plan.loads):
            guards += [
                Guard(next(rows), jump.kind, jump.text, load.name, load=number, mode=jump.mode)
                for jump in load.jumps
            ]
        if plan.lifting is not None:
            guards += [
                Guard(next(rows), "contact_lifted", "lifts", name, contact=i)
                for i, name in enumerate(plan.lifting.names)
            ]
        for kind, text in (("contact_slips", "slips"), ("contact_sticks", "sticks")):
            guards += [
                Guard(next(rows), kind, text, machine.contact_names[i], contact=number)
                for number, i in enumerate(plan.sticking)
            ]
        for i in np.flatnonzero(plan.flanks).tolist():
            row = int(self.columns.result("drive_beyond")[i])
            guards.append(Guard(row, "flank", "", machine.chains[i].name, flank=True))
        for result, kind, text in (
            ("drive_slips", "drive_slips", "breaks away"),
            ("drive_stops", "drive_sticks", "comes to rest"),
        ):
            guards += [
                Guard(int(self.columns.result(result)[i]), kind, text, machine.chains[i].name,
                      contact=number)
                for number, i in enumerate(plan.gripping)
            ]  # fmt: skip
        return guards

    # -- a state ------------------------------------------------------------------------------

    def evaluate(self, t: float, y: np.ndarray) -> None:
        """Evaluate a state; results by name are those of the last evaluation.

        Raises: NoRateError: where there are none.
        """
        columns, m = self.columns, len(self.plan.q)
        columns.given[: 2 * m, 0] = y[: 2 * m]
        for port, rows in self.lags.items():
            columns.give(port, y[rows])
        for table in self.tables:
            columns.give(table.port, table.at(t))
        status = columns.run()
        if self.plan.functions:
            self._ask(t)
            status = columns.run()
        if self.laws is not None and status in (0, AGAIN):
            pressing = self.laws.forces(*(self[name][None] for name in INDENTED)).force[0]
            if not np.isfinite(pressing).all():
                raise NoRateError(Status.unreachable)
            columns.give("pressing_force", pressing)
            status = columns.run()
        if status == AGAIN:
            self._robustly(y)
        elif status:
            raise NoRateError(status)

    def at_states(
        self, t: np.ndarray, state: np.ndarray, modes: np.ndarray, effort: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Results that do not depend on accelerations, at states (N, size), modes (N, loads) and
        efforts (N, n)."""
        columns, m = self.columns, len(self.plan.q)
        ports = {
            name: np.tile(columns.given[columns.rows(name), 0], (len(t), 1)).reshape(-1, *shape)
            for name, shape in shapes_of(columns.kernel.interface).items()
        }
        ports["q"], ports["q1"] = state[:, :m], state[:, m : 2 * m]
        ports["effort"] = effort
        ports |= {port: state[:, rows] for port, rows in self.lags.items()}
        count = len(self.plan.loads)
        for i in range(count):
            ports[f"load_{i}_mode"] = modes[:, i : i + 1].astype(float)
        if self.plan.lifting is not None:
            ports["active"] = modes[:, count:].astype(float)
        if self.plan.sticking:
            ports["stuck"] = modes[:, count:].astype(float)
            ports["slip_direction"] *= 0.0
        if self.plan.drives is not None:
            ports["flank"] = np.full_like(ports["flank"], BY_STATE)
        if self.plan.gripping:
            ports["grips"] = self._by_chain(modes[:, count:].astype(float))
            ports["turn_direction"] = np.sign(ports["motor_rate"])
        for table in self.tables:
            if table.port != "effort":
                ports[table.port] = table.at(t)
        results = columns.kernel.run(ports).values
        for i, function in self.plan.functions.items():
            places = np.moveaxis(results["load_place"], -1, 0)[:, i]
            rows = [self._wrench(i, function, *x) for x in zip(t.tolist(), places, strict=True)]
            ports[f"load_{i}_{WRENCH}"] = np.array(rows)
        results = columns.kernel.run(ports).values if self.plan.functions else results
        if self.laws is not None:
            indented = (np.moveaxis(results[name], -1, 0) for name in INDENTED)
            ports["pressing_force"] = self.laws.forces(*indented).force
            results = columns.kernel.run(ports).values
        return {name: np.moveaxis(a, -1, 0) for name, a in results.items()}

    def __getitem__(self, name: str) -> np.ndarray:
        """A result of the last evaluation."""
        return self.columns[name]

    def _ask(self, t: float) -> None:
        """Loads that are functions in Python."""
        places = self["load_place"].reshape(-1, 6)
        for i, function in self.plan.functions.items():
            self.columns.give(f"load_{i}_{WRENCH}", self._wrench(i, function, t, places[i]))

    def _wrench(
        self, i: int, function: Callable[..., Any], t: float, place: np.ndarray
    ) -> np.ndarray:
        wrench = np.asarray(function(t, place[:3], place[3:]), dtype=float).ravel()
        if wrench.shape not in ((3,), (6,)) or not np.isfinite(wrench).all():
            raise InputError(
                f'load "{self.plan.loads[i].name}": at t = {t:g} s its function returned '
                f"{wrench!s:.80}; expected a force (3,) [N], or a force and a moment (6,) "
                "[N, N m], finite"
            )
        return np.concatenate([wrench, np.zeros(6 - len(wrench))])

    def _robustly(self, y: np.ndarray) -> None:
        """Accelerations and contact forces where the kernel cannot vouch for its own."""
        columns, m = self.columns, len(self.plan.q)
        if self["certain"][0] < CERTAIN:
            closes = self._model.inverse_kinematics(y[:m]).status == Status.ok
            raise NoRateError(Status.uncertified if closes else Status.unreachable)
        if self.plan.lifting is not None or self.plan.sticking:
            raise NoRateError(Status.uncertified)
        asked = columns.given[columns.rows("effort"), 0]
        effort = np.clip(asked, self.plan.low, self.plan.high)
        effort = self["delivered"] if self.lags else effort
        around: Any = {n: columns.given[columns.rows(n), 0] for n in self.plan.given}
        result = self._model.forward_dynamics(y[:m], y[m : 2 * m], effort, self["wrench"], **around)
        if result.status:
            raise NoRateError(int(result.status))
        force, rate = result.contact_force, columns.result("rate")
        columns.found[rate[m : 2 * m], 0] = result.acceleration
        columns.found[rate[2 * m + 3], 0] = np.abs(force) @ self["rub"]
        columns.found[columns.result("contact_force"), 0] = force
        first = len(FACES) * len(self._bounded)
        pulled = columns.result("guards")[first : first + len(self._sided)]
        columns.found[pulled, 0] = -self._push * force[self._sided]


def fed(plans: Sequence[Plan]) -> list[Fed]:
    """Tables of what changes with time alone, of plans that are alike."""

    def stacked(rows: list[np.ndarray]) -> np.ndarray:
        return np.stack(rows, axis=2)

    tables = [
        Fed(f"load_{i}_{WRENCH}", load.times, stacked([p.loads[i].rows for p in plans]), True)
        for i, load in enumerate(plans[0].loads)
        if len(load.times)
    ]
    for name in plans[0].given:
        paths = [p.path for p in plans if p.path is not None]
        rows = stacked([np.asarray(path.around[name]) for path in paths])  # type: ignore[literal-required]
        tables.append(Fed(name, paths[0].times, rows, name == "base"))
    if isinstance(plans[0].drive, OpenLoop):
        efforts = stacked([p.drive.efforts for p in plans])  # type: ignore[union-attr]
        tables.append(Fed("effort", plans[0].drive.times, efforts, False))
    return tables


def bounds(plan: Plan, contacts: list[int]) -> np.ndarray:
    """Bounds of contact points, (6 contacts,) [m]: low and high, `WIDE` where there is none."""
    own = [plan.model.mechanism.contacts[i].bounds for i in contacts]
    ends = [[getattr(one, axis) or (-WIDE, WIDE) for axis in "xyz"] for one in own]
    return np.array(ends, dtype=float).swapaxes(1, 2).ravel()
