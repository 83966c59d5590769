"""Target `controller`: a scenario's controller in C, with what a machine needs around it.

The tick is the question that `simulate` runs and `check_gains` linearises, with the scenario's
numbers. Around it stands one text in C (`c_controller.c`): the states of `controller_states.py`,
faults with names, smooth changes, a clamp that no effort passes, and a ring of records.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError, UnsupportedError
from ..files.atomic import make_folder
from ..mechanism import Mechanism
from ..model.model import Model, derive
from ..motion.table_writer import write_table
from ..questions.kalman import BEFORE as FILTERED
from ..questions.observer import BEFORE, EXACT, KALMAN
from ..questions.tick import REFERENCE
from ..questions.tick_limits import BEFORE as LIMITED
from ..simulation.plan import ClosedLoop, Plan
from ..simulation.simulating import ScenarioLike, planned
from ..version import __version__
from .c_function import LIMITS
from .c_source import export
from .catalogue import CEntry
from .controller_settings import Setting, settings_of
from .controller_states import c_states
from .exported import Exported, Function
from .syntax import file_text, filled, literal, packaged
from .written import Written, write_texts

# Arguments of the tick -> where they come from, in C.
MEASURED = {name: f"m.{name}" for name in ("joint", "joint_rate", "force", "acted")}
TO = {"q_d": "q", "q1_d": "q1", "q2_d": "q2", "joint_d": "joint", "joint_rate_d": "joint_rate"}
READ = {"joint": "joint_read", "joint_rate": "joint_rate_read"}  # results, which ports are too
GIVEN = "effort_before"  # which is what the machine was given last, in any state
CARRIED = {
    "memory_before": "memory", **{port: READ.get(one, one) for port, one in BEFORE.items()},
    **FILTERED, **LIMITED,
}  # fmt: skip
del CARRIED[GIVEN]
FOUND = {"effort": "asked", "q": "c->q", "q1": "c->q1", "joint_rate_read": "rate"}


@dataclass(frozen=True)
class ControllerSource:
    """A controller in C.

    exported: the tick, and joints from the state;  texts: of all files, by name;
    settings: in the order of the structure in C;  reference: what it follows, columns.
    plan: of the simulation that has the same controller.
    """

    exported: Exported
    texts: Mapping[str, str]
    settings: list[Setting]
    plan: Plan
    drive: ClosedLoop

    @property
    def reference(self) -> dict[str, np.ndarray]:
        """The scenario's path at every tick: t, q, q', q'' and the force."""
        t = self.plan.ticks()
        rows = self.drive.path.at(t)
        m = len(self.plan.q)
        free = self.drive.model.independent
        columns = [prefix + name for prefix in ("", "d", "dd") for name in free]
        force = rows[:, 3 * m + 2 * len(self.plan.low)]
        return {"t": t, **dict(zip(columns, rows[:, : 3 * m].T, strict=True)), "force": force}

    @property
    def in_time(self) -> ControllerSource:
        """The same without ticks that are missed."""
        plan = replace(self.plan, drive=replace(self.drive, misses=None))
        return replace(self, plan=plan)

    @property
    def lacks(self) -> list[str]:
        """What of the scenario is neither in the controller nor in a plant without loads whose
        contacts are kept."""
        kind = self.plan.scenario.contacts.kind
        return self.left_out + [f"{kind} contacts, which are kept"] * (kind != "kept")

    @property
    def left_out(self) -> list[str]:
        """The same of a plant whose contacts are those of the scenario."""
        sensing = self.drive.sensing
        names = [f"load {load.name}" for load in self.plan.loads]
        names += ["encoder_noise"] * bool(sensing is not None and sensing.noise)
        return names + ["jitter and missed ticks"] * (self.drive.misses is not None)


def export_controller(
    model: Model | Mechanism | str | os.PathLike[str],
    scenario: ScenarioLike,
    path: str | os.PathLike[str],
    *,
    prefix: str | None = None,
    size: str = "fast",
) -> Written:
    """Write a scenario's controller as C99, with its states, watchdog and log.

        condyle.export_controller("masticatory", "chew.toml", "controller")

    Args:   model: a model, a mechanism, its file, or the name of a bundled one.
            scenario: file (TOML), or as of `condyle.simulate`, with a controller and sensors.
            path: a folder;  prefix: of all names in C; default: the mechanism's name.
            size: fast, or small: with loops, for processors with little memory.
    Returns: the files; `path.csv` is what the scenario follows. `make facts` there measures code,
             stack and memory for a target.
    Raises: InputError, UnsupportedError: for a scenario without a controller that runs by itself.
    """
    made, folder = controller_source(model, scenario, prefix, size), make_folder(path)
    e = made.exported
    words = {"prefix": e.prefix, "operations": e["tick"].operations}
    build = {"Makefile": "controller.mk", "facts.awk": "controller_facts.awk"}
    measuring = {file: filled(packaged(template), words) for file, template in build.items()}
    files = write_texts(folder, {**made.texts, **measuring})
    files.append(folder / "path.csv")
    write_table(files[-1], made.reference)
    data = {
        "mechanism": e.mechanism.name,
        "prefix": e.prefix,
        "law": made.plan.scenario.controller.kind,
        "period": made.drive.period,
    }
    return Written(files, (), data)


def controller_source(
    model: Model | Mechanism | str | os.PathLike[str],
    scenario: ScenarioLike,
    prefix: str | None,
    size: str = "fast",
) -> ControllerSource:
    """As `export_controller`, in memory."""
    own = model if isinstance(model, Model) else derive(model)
    (plan,) = planned(own, [scenario])
    drive = _drive(plan)
    law, sensing = drive.law, drive.sensing
    assert law.table is not None and sensing is not None
    details = (law.table, law.choices, sensing.observer, drive.limits)
    limits = {"low": plan.low, "high": plan.high, **drive.numbers}
    entry = CEntry(
        "A tick: the state from encoders, the law, and its efforts within the actuators' limits.",
        results="effort q q1 memory pose pose_rate joint>joint_read joint_rate>joint_rate_read "
        "estimate covariance begun contact_force begun_limits unconverged",
        question="tick",
        details=lambda wish: details,
        rubbing="UNCERTIFIED",
        doubt="UNREACHABLE",
        limits={name: np.ravel(limits[name]).tolist() for name in LIMITS if name in limits},
    )
    how: dict[str, Any] = {"prefix": prefix, "lanes": 0, "size": size}
    exported = export(drive.model, ("joints",), **how, entries={"tick": entry})
    settings = settings_of(plan, drive, exported["tick"])
    return ControllerSource(
        exported, _texts(exported, plan, drive, settings), settings, plan, drive
    )


def _drive(plan: Plan) -> ClosedLoop:
    """Raises InputError for what is no controller of its own."""
    drive = plan.drive
    if not isinstance(drive, ClosedLoop) or drive.law.table is None or drive.function is not None:
        raise InputError(
            f"{plan.source}: expected a scenario with [controller], which is what is exported"
        )
    if drive.period is None:
        raise InputError(f"{plan.source}: controller.ideal has no ticks; give it a rate")
    if drive.sensing is None:
        raise InputError(
            f"{plan.source}: without [sensors] the controller is given the state itself, which no "
            "machine has; add [sensors], if only encoder_resolution = 0.0"
        )
    if drive.model.chooses_efforts and not drive.limits.chooses:
        raise UnsupportedError(
            f"{plan.source}: distribution {drive.model.distribution.name} chooses efforts outside "
            'the tick; take controller.distribution = "bounded", "weighted" or "minimum_norm"'
        )
    if plan.given:
        raise UnsupportedError(
            f"{plan.source}: the motion gives {' and '.join(plan.given)} over time, which the "
            "exported controller does not take; leave these columns out"
        )
    return drive


def _texts(e: Exported, plan: Plan, drive: ClosedLoop, settings: list[Setting]) -> dict[str, str]:
    machine, sensing, tick = e.mechanism, drive.sensing, e["tick"]
    assert sensing is not None and drive.period is not None
    n, m = len(machine.chains), len(drive.model.independent)
    sizes = {a.name: a.size for a in tick.arguments}
    force = "force" in sizes
    kind = plan.scenario.controller.kind
    fixed = {"RESOLUTION": sensing.numbers["resolution"], "ZERO": np.array(machine.zeros)}
    fixed |= {"LOW": plan.low, "HIGH": plan.high}
    carried = {"pose_before": 6, "pose_rate_before": 6, "joint_before": n, "joint_rate_before": n}
    carried |= {name: size for name, size in sizes.items() if name in CARRIED}
    numbers = {**sensing.numbers, **drive.numbers}
    own = {name: numbers[name] for name in numbers if name in sizes and name != "resolution"}
    filters, reset = sensing.observer == KALMAN, ""
    if "memory_before" in sizes:
        reset = "".join(
            f"    c->memory_before[{i}] = {literal(x, 'double')};\n"
            for i, x in enumerate(drive.law.memory)
        )
    safety, table = plan.scenario.safety, drive.law.table
    rest = table.resting if table else None
    if safety.trips.contact is not None and "contact_before" not in sizes:
        raise UnsupportedError(
            f"{plan.source}: safety.trips.contact needs contact forces, which the tick knows with "
            'controller.distribution = "bounded", "weighted" or "minimum_norm"; remove it'
        )
    limited = drive.numbers.get("effort_rate")
    fixed["RATE"] = np.full(n, np.inf) if limited is None else np.ravel(limited)
    named = {"prefix": e.prefix, "PREFIX": e.prefix.upper()}
    names = {
        "name": machine.name,
        "joints": ", ".join(machine.chain_names),
        "free": ", ".join(drive.model.independent),
    }
    words = {
        **named,
        "law": kind,
        "rate": f"{1 / drive.period:g}",
        "version": __version__,
        "n": n,
        "m": m,
        "tachometers": "used" if sensing.observer == EXACT else "not used by this observer",
        "forced": "used" if force else "not used by this law",
        "acted": f"\n    double acted[{n}]; /* efforts that acted since the last tick */" * filters,
        "start": "    memcpy(c->estimate_before, q, sizeof c->q);\n"
        "    memcpy(c->estimate_before + M, q1, sizeof c->q1);\n" * filters,
        "settings": "".join(setting.declared for setting in settings),
        "values": ",\n    ".join(setting.value for setting in settings),
        "carried": "".join(f"    double {name}[{size}];\n" for name, size in carried.items()),
        "contact": filled(_CONTACT, named) * ("contact_before" in sizes),
        "rest": "".join(
            f"        c->memory_before[{i}] = {literal(x, 'double')};\n"
            for i, x in enumerate(rest or ())
        ),
        **c_states(named["PREFIX"]),
        "tables": "".join(
            f"static const double {name}[N] = {{{_row(row)}}};\n" for name, row in fixed.items()
        ),
        "reset": reset,
        "call": ",\n        ".join(
            _argument(e, tick, a.name, a.given, own) for a in tick.arguments
        ),
        "locals": "".join(
            f"    double {name}_new[{sizes[name]}];\n" for name in _stored_results(tick)
        )
        + "".join(
            f"    static const double {name}[{sizes[name]}] = {{{_row(np.ravel(x))}}};\n"
            for name, x in own.items()
        ),
        "keep": "".join(
            f"        memcpy(c->{port}, {_result(result)}, sizeof c->{port});\n"
            for port, result in CARRIED.items()
            if port in sizes
        )
        + "        c->unconverged += unconverged_new[0] > 0.5 ? 1u : 0u;\n"
        * ("unconverged" in sizes),
    }
    texts = {
        f"{e.prefix}.h": e.header,
        f"{e.prefix}.c": e.source,
    }
    for suffix in ("h", "c"):
        file = f"{e.prefix}_controller.{suffix}"
        texts[file] = file_text(file, f"c_controller.{suffix}", words, names)
    return texts


_CONTACT = """\
    {
        int lifted = 0;
        for (i = 0; i < (int)(sizeof c->contact_before / sizeof *c->contact_before); i++)
            lifted |= !(c->contact_before[i] > 0.0);
        c->unloaded = lifted ? c->unloaded + given->period : 0.0;
        if (c->unloaded > given->contact) c->active |= 1u << @PREFIX@_CONTACT;
    }
"""


def _stored_results(tick: Function) -> list[str]:
    """Results that need a place of their own."""
    return [a.name for a in tick.outputs if a.name not in FOUND]


def _result(name: str) -> str:
    return FOUND.get(name, f"{name}_new")


def _argument(e: Exported, tick: Function, name: str, given: bool, fixed: Collection[str]) -> str:
    """What an argument of the tick is given. Args: fixed: those that never change."""
    if not given:
        return _result(name)
    if name in MEASURED:
        return MEASURED[name]
    if name in TO:
        return f"to.{TO[name]}"
    if name == REFERENCE[5]:
        return "&to.force"
    if name in CARRIED:
        return f"c->{name}"
    if name == "period":
        return "&c->settings.period"
    if name == "resolution":
        return "RESOLUTION"
    if name == GIVEN:
        return "c->effort"
    return name if name in fixed else f"c->settings.{name}"


def _row(values: np.ndarray) -> str:
    return ", ".join(literal(float(x), "double") for x in values)
