"""What an FMU is of a mechanism, in C: its variables, and how they follow from each other.

Six kinds: the `plant` (efforts and a load in, motion and readings out), the `inverse` model (a
motion in, efforts out), `bounded`, the same within limits, the `controller` (computed torque; that
of a scenario is in `fmu_controller.py`), `pose` (encoders in) and `joints` (independent coordinates
in). Every array of the exported functions is a row of scalar variables, called as array and label:
`effort.masseter_left`, `q.X`.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from ..errors import InputError, did_you_mean
from ..kinematics.chain import FAMILIES
from ..mechanism import Mechanism
from ..mechanism.chain import CHAINS
from ..mechanism.quantities import number_fields
from ..questions.derivative import PREFIX
from ..simulation.plan import FreedContacts
from .c_context import CODES as C_CODES
from .c_source import export
from .catalogue import READ, TANGENT
from .exported import CArray, Exported
from .fmu_lifting import (
    QUESTION as LIFTING,
)
from .fmu_lifting import lifting_arrays, lifting_code, lifting_entries, lifting_macros
from .syntax import identifier

FmuKind = Literal["plant", "inverse", "controller", "bounded", "pose", "joints"]
KINDS: dict[str, tuple[str, ...]] = {
    "plant": ("forward", "motion", "joints"),
    "inverse": ("contact",),
    "controller": ("computed_torque",),
    "bounded": ("bounded",),
    "pose": ("pose",),
    "joints": ("joints",),
}
TEXTS = {
    "plant": "Forward dynamics: efforts and a load in, motion and contact forces out",
    "inverse": "Inverse dynamics: a motion and a load in, efforts and contact forces out",
    "controller": "Computed torque: desired and measured motion in, efforts out",
    "bounded": "Inverse dynamics within limits: a motion and a load in, efforts and forces out",
    "pose": "Forward kinematics: joint coordinates in, the pose out",
    "joints": "Inverse kinematics: independent coordinates in, joints and the pose out",
}
ROUGH = ("bounded", "pose")  # kinds without derivatives
STATES, RATES = ("q", "q1"), ("dq", "acceleration")
FOLLOWING = frozenset({"pose", "pose_rate", "joint", "joint_rate", "reading"})  # states alone
PARAMETERS = ("point", "kp", "kd", "start")
STARTS = {"kp": 400.0, "kd": 40.0}
TOLERANCE = 1e-9  # of a step of the plant, relative and absolute
ZERO = (  # without these
    "TICKS", "DIRECTIONAL", "ORDER", "STATES", "DERIVATIVES", "TOLERANCE", "FACES", "INDICATORS",
)  # fmt: skip
CODES = ", ".join(f"{code:d} {name.replace('_', ' ').lower()}" for name, code in C_CODES.items())

FAILED = "    if (status)\n        return status;"

# Powers of kg, m, s, rad in units of ours.
BASE = {name: {name: 1} for name in ("m", "rad", "kg", "s")} | {"N": {"kg": 1, "m": 1, "s": -2}}


@dataclass(frozen=True)
class FmuVariable:
    """A variable.

    role:  "input", "parameter", "fixed" (a parameter until it begins), "state", "rate" (of a
           state), "output", "mode" (an output that changes at events alone), or "indicator" (of
           events).
    index: value reference;  of: that of the state whose rate it is.
    """

    name: str
    role: str
    unit: str
    text: str
    index: int
    start: float | None = None
    of: int | None = None


@dataclass(frozen=True)
class Fmu:
    """Variables in the order of their references; C of all of it, without the interface.

    order:     number of states.
    following: names of arrays of outputs that inputs do not change at once.
    indicators: references of the event indicators.
    period:    of ticks [s], by which it goes on; 0: without ticks.
    duration:  of a run [s].
    """

    name: str
    text: str
    token: str
    variables: tuple[FmuVariable, ...]
    order: int
    files: dict[str, str]
    head: str
    differentiable: bool
    following: frozenset[str]
    indicators: tuple[int, ...] = ()
    period: float = 0.0
    duration: float = 1.0


class Variables:
    """Variables under way, and the place where each array begins. Args: names: of labels, in C."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self.rows: list[FmuVariable] = []
        self.places: dict[str, int] = {}
        self._names = names

    def add(self, role: str, a: CArray, starts: Iterable[float] | None = None) -> None:
        """Every entry of an array; one that has no name but the array's is called as that.

        Args: starts: default: those of gains, and 0.
        """
        self.places[a.name] = len(self.rows)
        given = role in ("input", "parameter", "fixed", "state")
        if starts is None and given:
            starts = [STARTS.get(a.name, 0.0)] * a.size
        known = [*map(float, starts)] if given and starts is not None else [None] * a.size
        for label, unit, start in zip(a.labels, a.units, known, strict=True):
            name, text = f"{a.name}.{self._names.get(label) or identifier(label)}", a.text
            name, text = (a.name, text) if label == a.name else (name, f"{text}: {label}")
            self.add_scalar(role, name, regular_unit(unit), text, start)

    def add_scalar(
        self, role: str, name: str, unit: str, text: str, start: float | None = None
    ) -> None:
        self.places.setdefault(name, len(self.rows))
        self.rows.append(FmuVariable(name, role, unit, text, len(self.rows), start))


# A number of the mechanism that can be changed: name, unit, text and start of its parameter, and
# code that puts it, as `value`, into `n`.
Tuned = tuple[str, str, str, float, str]


def fmu_model(
    mechanism: Mechanism,
    kind: str,
    start: Mapping[str, np.ndarray] = MappingProxyType({}),
    lifting: FreedContacts | None = None,
) -> Fmu:
    """The model of a kind.

    Args:   start: q and q1 where a plant begins; default: at rest at home.
            lifting: contacts of a plant that lift and land, which the mechanism is without.
    Raises: InputError: for another kind;  UnsupportedError: for a mechanism that C export has not.
    """
    if kind not in KINDS:
        raise InputError(f'kind: no FMU "{kind}".{did_you_mean(kind, KINDS)}')
    questions = KINDS[kind]
    tangents = [f"{question}{TANGENT}" for question in questions if kind not in ROUGH]
    entries = {}
    if lifting is not None:
        entries, tangents = lifting_entries(lifting), []
        questions = (LIFTING, *questions[1:])
    asked = [question for question in questions if question not in entries]
    e = export(mechanism, [*asked, *tangents], constants="struct", lanes=0, entries=entries)
    plant, calls = kind == "plant", [e[question] for question in questions]
    arrays = {a.name: a for f in calls for a in f.arguments}
    if lifting is not None:
        arrays = lifting_arrays(lifting, arrays)
    states, rates = (STATES, RATES) if plant else ((), ())
    if plant:
        arrays["dq"] = replace(arrays["q1"], name="dq", given=False, text="rates of q")
        arrays["reading"] = replace(arrays["joint"], name="reading", text=READ["joint"][0])
    # A result of one function that another takes stands once: the acceleration of `motion`.
    outputs = {a.name for a in arrays.values() if not a.given} | {"reading"}
    made = [name for name in arrays if name in outputs]
    taken = {*states, *rates, "q2"} if plant else set()
    given = [name for name, a in arrays.items() if a.given and name not in taken]
    variables = Variables(e.names)
    places, add, add_scalar = variables.places, variables.add, variables.add_scalar
    for role, parameters in (("input", False), ("parameter", True)):
        for name in given:
            if (name in PARAMETERS) == parameters:
                add(role, arrays[name])
    tuned = list(_tuned(mechanism, e))
    for t in tuned:
        add_scalar("parameter", *t[:4])
    if plant:
        add_scalar("parameter", "tolerance", "1", "error tolerance of a step", TOLERANCE)
    for name in states:
        add("state", arrays[name], start.get(name))
    add_scalar("output", "status", "1", CODES)
    roles = {**dict.fromkeys(rates, "rate"), "active": "mode", "event_indicator": "indicator"}
    for name in (*rates, *(name for name in made if name not in rates)):
        add(roles.get(name, "output"), arrays[name])
    order = places["status"] - places["q"] if plant else 0
    for i in range(order):
        rate = places["dq"] + i
        variables.rows[rate] = replace(variables.rows[rate], of=places["q"] + i)
    freed = lifting is not None
    body = lifting_code(lifting, e, places) if lifting is not None else ""
    body += _evaluate(e, kind, places, rates=True, freed=freed) if plant else ""
    body += _evaluate(e, kind, places, freed=freed)
    body += _prepare(e, tuned, places) + takes(_bounds(places))
    if tangents:
        body += _evaluate(e, kind, places, TANGENT)
    macros: dict[str, object] = {
        "DIRECTIONAL": int(bool(tangents)),
        "TUNED": places[tuned[0][0]],
        "TUNED_END": places.get("q", places["status"]) if plant else places["status"],
        "ORDER": order,
    }
    if plant:
        known = {"STATES": "q", "DERIVATIVES": "dq", "TOLERANCE": "tolerance"}
        macros |= {name: places[one] for name, one in known.items()}
    if lifting is not None:
        macros |= lifting_macros(lifting, mechanism, places)
    return assembled(
        e,
        kind,
        variables,
        macros,
        f"typedef {e.prefix}_constants model_constants;\n\n{body}",
        {f"{e.prefix}.c": e.source, f"{e.prefix}.h": e.header},
        text=f"{TEXTS[kind]}, of {mechanism.name}",
        order=order,
        differentiable=bool(tangents),
        following=FOLLOWING | {"gap"} if plant else frozenset(),
        indicators=()
        if lifting is None
        else tuple(v.index for v in variables.rows if v.role == "indicator"),
    )


def assembled(
    e: Exported,
    kind: str,
    variables: Variables,
    macros: Mapping[str, object],
    body: str,
    files: Mapping[str, str],
    **about: Any,
) -> Fmu:
    """An FMU of its parts.

    Args: macros: of `fmi.c` but those of variables;  files: the sources, all that end in .c to be
          included;  about: further fields.
    """
    macros = {
        "VALUES": len(variables.rows),
        "COMPUTED": variables.places["status"],
        "STATUS": variables.places["status"],
        **dict.fromkeys(ZERO, 0),
        **macros,
        "START": "{" + ", ".join(repr(v.start or 0.0) for v in variables.rows) + "}",
    }
    head = "".join(f'#include "{name}"\n' for name in files if name.endswith(".c"))
    head += "".join(f"#define MODEL_{name} {value}\n" for name, value in macros.items()) + body
    token = hashlib.sha256("".join([*files.values(), head]).encode()).hexdigest()[:32]
    return Fmu(
        name=f"{e.prefix}_{kind}",
        token=f"{{{token[:8]}-{token[8:12]}-{token[12:16]}-{token[16:20]}-{token[20:]}}}",
        variables=tuple(variables.rows),
        files=dict(files),
        head=head,
        **about,
    )


def _tuned(mechanism: Mechanism, e: Exported) -> Iterator[Tuned]:
    """Gravity, mass, mass centre and inertia of the platform, and numbers of single chains."""
    platform = mechanism.platform
    losses = any(not chain.actuator.ideal for chain in mechanism.chains)
    for i, (axis, start) in enumerate(zip("xyz", map(float, mechanism.gravity), strict=True)):
        about = f"gravity.{axis}", "m/s^2", f"gravity along {axis} of {{S}}"
        yield *about, start, f"n.gravity[{i}] = value"
    yield "platform.mass", "kg", "mass of the platform", platform.mass, "n.mass = value"
    for i, (axis, start) in enumerate(zip("xyz", map(float, platform.com), strict=True)):
        about = f"platform.com.{axis}", "m", f"mass centre of the platform along {axis} of {{M}}"
        yield *about, start, f"n.com[{i}] = value"
    for i, key in enumerate(("xx", "yy", "zz", "xy", "xz", "yz")):
        start = float(getattr(platform.inertia, key))
        about = f"platform.inertia.{key}", "kg m^2", f"inertia {key} of the platform"
        yield *about, start, f"n.inertia[{i}] = value"
    seen = Counter[str]()
    for chain in mechanism.chains:
        name, at = e.names[chain.name], f"n.{chain.kind}[{seen[chain.kind]}]"
        seen[chain.kind] += 1
        family = FAMILIES[chain.kind]
        for key, (path, text) in family.tuned.items():
            unit = number_fields(CHAINS[chain.kind])[path].unit.unit
            about = f"{key}.{name}", unit, f"{text} of {chain.name}"
            yield *about, attrgetter(path)(chain), f"{at}.{path.replace('.', '_')} = value"
        if losses:
            text = f"friction of {chain.name}"
            units = f"{family.effort_unit} s/{family.joint_unit}", family.effort_unit
            for key, unit in zip(("viscous", "coulomb"), units, strict=True):
                own = getattr(chain.actuator, key), f"{at}.actuator_{key} = value"
                yield f"{key}.{name}", unit, text, *own


def takes(bounds: Mapping[str, Sequence[int]]) -> str:
    """Whether a variable takes a value. Args: bounds: such as ">= 0.0" -> variables."""
    lines = ["static int model_takes(uint32_t which, double value)", "{", "    switch (which) {"]
    for bound, places in bounds.items():
        if places:
            lines += [f"    case {i}:" for i in places]
            lines[-1] += f" return value {bound} && value < HUGE_VAL;"
    return "\n".join([*lines, "    default: return 1;", "    }", "}", "", ""])


def _bounds(places: Mapping[str, int]) -> dict[str, list[int]]:
    """Masses and inertias are positive, those of bodies of chains and friction may be 0."""
    never = ("tolerance", "platform.mass", *(f"platform.inertia.{i * 2}" for i in "xyz"))
    own = (key for family in FAMILIES.values() for key in family.tuned)
    start = tuple(f"{key}." for key in (*own, "viscous", "coulomb"))
    return {
        "> 0.0": [i for name, i in places.items() if name in never],
        ">= 0.0": [i for name, i in places.items() if name.startswith(start)],
    }


def _evaluate(
    e: Exported,
    kind: str,
    places: dict[str, int],
    suffix: str = "",
    rates: bool = False,
    freed: bool = False,
) -> str:
    """Everything computed, in v, or rates of states alone; or with a suffix how it changes along
    d.

    Args: freed: whether contacts lift and land, whose function stands in the place of the first.
    """
    name, to = ("differentiate", "d") if suffix else ("rates" if rates else "evaluate", "v")
    questions, zeros = KINDS[kind], e.mechanism.zeros if kind == "plant" and not rates else ()
    given = ", const double *v, double *d" if suffix else ", double *v"
    lines = [f"static int model_{name}(const model_constants *of{given})", "{"]
    if kind == "plant":
        m = len(e["motion"].inputs[0].labels)
        size = f"{m} * sizeof *v"
        lines += [f"    memcpy({to} + {places['dq']}, {to} + {places['q1']}, {size});"]
    lines.append("    int status;")
    for question in questions[: 1 if rates else None]:
        if freed and question == questions[0]:
            lines.append(f"    status = model_pressed(of, v, {int(not rates)});\n{FAILED}")
            continue
        function = e[f"{question}{suffix}"]
        words = "of"
        for a in function.arguments:
            own = a.name.removeprefix(PREFIX) if suffix else a.name
            place = places["acceleration" if kind == "plant" and own == "q2" else own]
            words += f", {'v' if own == a.name else 'd'} + {place}"
        lines.append(f"    status = {function.name}({words});\n{FAILED}")
    for i, zero in enumerate(zeros):
        offset = "" if suffix else f" + {zero!r}"
        lines.append(f"    {to}[{places['reading'] + i}] = {to}[{places['joint'] + i}]{offset};")
    return "\n".join([*lines, "    return 0;", "}", "", ""])


def _prepare(e: Exported, tuned: list[Tuned], places: dict[str, int]) -> str:
    lines = ["static void model_prepare(const double *v, model_constants *of)", "{"]
    lines += [f"    {e.prefix}_numbers n = {e.prefix.upper()}_NUMBERS;"]
    lines += [f"    {put.replace('value', f'v[{places[name]}]')};" for name, *_, put in tuned]
    return "\n".join([*lines, f"    {e.prefix}_prepare(&n, of);", "}", ""])


def exponents(unit: str) -> dict[str, int]:
    """Powers of the base units: "kg m^2", "N m", "m/s^2", "1/s"."""
    powers: dict[str, int] = {}
    above, _, below = unit.partition("/")
    for part, sign in ((above, 1), (below, -1)):
        for word in part.split():
            name, _, power = word.partition("^")
            if re.fullmatch(r"\d+", name):
                continue
            for base, n in BASE[name].items():
                powers[base] = powers.get(base, 0) + sign * n * int(power or 1)
    return powers


def regular_unit(unit: str) -> str:
    """The unit, or 1 for one that has no whole powers of base units, as units of alternatives."""
    try:
        exponents(unit)
    except (KeyError, ValueError):
        return "1"
    return unit
