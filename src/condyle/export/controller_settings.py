"""The settings of an exported controller as data: its C and the parameters of its FMU read them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..kinematics.chain import FAMILIES
from ..questions.entries import each
from ..simulation.brake import brake
from ..simulation.plan import ClosedLoop, Plan
from .exported import Function
from .syntax import c_comment, literal

STOPS = ("brake", "hold_then_release", "hold")
SEARCHES = ("index", "stop")  # from 1 on; 0: none


@dataclass(frozen=True)
class Setting:
    """A number of the settings, or a row of them.

    name:   in C;  values: those of the scenario.
    labels: of a row's entries, none of a single number;  units: one, or one for each entry.
    whole:  a whole number;  signed: it may be negative.
    """

    name: str
    text: str
    values: np.ndarray
    labels: tuple[str, ...] = ()
    units: tuple[str, ...] = ("1",)
    whole: bool = False
    signed: bool = False

    @property
    def kind(self) -> str:
        return "int" if self.whole else "double"

    @property
    def declared(self) -> str:
        """As a member of the structure."""
        size = f"[{len(self.labels)}]" if self.labels else ""
        units = " or ".join(dict.fromkeys(self.units))
        unit = "" if units == "1" else f" [{units}]"
        return f"    {self.kind} {self.name}{size}; /* {c_comment(self.text + unit)} */\n"

    @property
    def value(self) -> str:
        """Its part of an initialiser."""
        row = [str(int(x)) if self.whole else literal(float(x), "double") for x in self.values]
        return f"{{{', '.join(row)}}}" if self.labels else row[0]


def settings_of(plan: Plan, drive: ClosedLoop, tick: Function) -> list[Setting]:
    """All settings of a scenario's controller, in the order of the structure.

    Raises: InputError: for a search that leads nowhere.
    """
    machine, safety = plan.model.mechanism, plan.scenario.safety
    trips, chains = safety.trips, machine.chain_names
    families = [FAMILIES[chain.kind] for chain in machine.chains]
    joint = tuple(family.joint_unit for family in families)
    rate = tuple(f"{unit}/s" for unit in joint)
    damping = tuple(f"{family.effort_unit} s/{family.joint_unit}" for family in families)

    def number(
        name: str, text: str, value: float | None, *units: str, whole: bool = False
    ) -> Setting:
        values = np.array([np.inf if value is None else value])
        return Setting(name, text, values, units=units or ("1",), whole=whole)

    def row(name: str, text: str, values: np.ndarray, units: tuple[str, ...]) -> Setting:
        return Setting(name, text, values, chains, units)

    return [
        number("period", "period of the ticks", drive.period, "s"),
        number("homing", "duration of homing, and of joining the reference", safety.homing, "s"),
        number("ramp", "efforts rise from 0 in this time after off", safety.ramp, "s"),
        number("stopping", "duration of a safe stop", safety.stopping, "s"),
        row("brake", "damping in a safe stop", brake(plan, drive), damping),
        number("late", "a tick is late when it comes later than this, in periods", safety.late),
        number("late_most", "late ticks that are borne", safety.late_most, whole=True),
        number(
            "lost_most",
            "ticks with lost encoders, without a pose, or too fast, that are borne",
            safety.lost_most,
            whole=True,
        ),
        *_gains(drive, tick),
        number(
            "halting", "a speed is led to the next reference's in this time", safety.halting, "s"
        ),
        number("gap", "a gap of more periods stops at once", safety.gap),
        number("recovery", "what a good tick takes from counts of bad ones", safety.recovery),
        number(
            "stop",
            f"what a safe stop does: {_choices(STOPS)}",
            STOPS.index(safety.stop),
            whole=True,
        ),
        number("hold", "duration of hold_then_release", safety.hold, "s"),
        number("tracking", "a joint may be this far from its reference", trips.tracking, *joint),
        number("overtaxed", "an effort may be at its limit for this time", trips.overtaxed, "s"),
        number("contact", "a contact may carry nothing for this time", trips.contact, "s"),
        row("speed", "a joint's largest speed", trips.speed * plan.speed, rate),
        number("jump", "of a reading, from what is expected", trips.encoder_jump, *joint),
        number(
            "stuck",
            "a reading may stand while its reference moves so far",
            trips.encoder_stuck,
            *joint,
        ),
        *_search(plan, tick, joint),
    ]


def _choices(names: tuple[str, ...]) -> str:
    return ", ".join(f"{i} {name}" for i, name in enumerate(names))


def _gains(drive: ClosedLoop, tick: Function) -> Iterator[Setting]:
    """The law's numbers."""
    known = {} if drive.law.table is None else drive.law.table.parameters
    for a in tick.inputs:
        if a.name in drive.law.numbers:
            values, unit = np.ravel(drive.law.numbers[a.name]), known.get(a.name)
            units = (unit.replace("²", "^2"),) if unit else a.units
            yield Setting(a.name, a.text, values, a.labels, units, signed=True)


def _search(plan: Plan, tick: Function, joint: tuple[str, ...]) -> Iterator[Setting]:
    """Settings of homing."""
    search, machine, (q,) = (
        plan.scenario.safety.search,
        plan.model.mechanism,
        [a for a in tick.outputs if a.name == "q"],
    )
    mark, reach, rest, until = np.zeros(len(joint)), np.zeros(q.size), np.zeros(4), 0
    if search is not None:
        where = f"{plan.source}: safety.search"
        until = 1 + SEARCHES.index(search.until)
        mark = np.broadcast_to(each(search.at, machine.chain_names, f"{where}.at"), len(joint))
        given = {name: x for name, x in search.reach.entries().items() if x}
        if not given or given.keys() - {*q.labels}:
            raise InputError(
                f"{where}.reach: got {', '.join(given) or 'no way'}; expected how far to go along "
                f"some of {', '.join(q.labels)}, such as reach.{q.labels[-1]} = 0.1"
            )
        reach = np.array([given.get(name, 0.0) for name in q.labels])
        rest = np.array([search.tolerance, search.within, search.effort, search.press])
    text = f"the first part of homing after off: {_choices(('none', *SEARCHES))}"
    yield Setting("search", text, np.array([until]), whole=True)
    text = "joints at their marks, or at the stop"
    yield Setting("mark", text, mark, machine.chain_names, joint, signed=True)
    yield Setting("reach", "how far it searches", reach, q.labels, q.units, signed=True)
    for name, text, units, value in zip(
        ("tolerance", "within", "search_effort", "press"),
        (
            "joints are off by less where it begins",
            "duration of a search",
            "share of the limits, in a search",
            "joints that stand for this time are at the stop",
        ),
        (joint, ("s",), ("1",), ("s",)),
        rest,
        strict=True,
    ):
        yield Setting(name, text, np.array([value]), units=units)
