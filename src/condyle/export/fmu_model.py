"""What an FMU is of a mechanism, in C: its variables, and how they follow from each other.

Six kinds: the `plant` (efforts and a load in, motion out), the `inverse` model (a motion in,
efforts out), `bounded`, the same within limits, the `controller`
(computed torque), `pose` (encoders in) and `joints` (independent coordinates in). Every array
of the exported functions is a row of scalar variables, called as array and label:
`effort.masseter_left`, `q.X`.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Literal

from ..errors import InputError, did_you_mean
from ..kinematics.chain import FAMILIES
from ..mechanism import Mechanism
from ..mechanism.chain import CHAINS
from ..mechanism.quantities import number_fields
from ..questions.derivative import PREFIX
from .c_context import CODES as C_CODES
from .c_source import export
from .catalogue import TANGENT
from .exported import CArray, Exported
from .syntax import identifier

FmuKind = Literal["plant", "inverse", "controller", "bounded", "pose", "joints"]
KINDS: dict[str, tuple[str, ...]] = {
    "plant": ("forward", "motion"),
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
PARAMETERS = ("point", "kp", "kd", "start")
STARTS = {"kp": 400.0, "kd": 40.0}
TOLERANCE = 1e-9  # of a step of the plant, relative and absolute
CODES = ", ".join(f"{code:d} {name.replace('_', ' ').lower()}" for name, code in C_CODES.items())


@dataclass(frozen=True)
class FmuVariable:
    """A variable.

    role:  "input", "parameter", "state", "rate" (of a state), or "output".
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
    """Variables in the order of their references; C of all of it, without the interface."""

    name: str
    text: str
    token: str
    variables: tuple[FmuVariable, ...]
    order: int
    files: dict[str, str]
    head: str
    differentiable: bool


# A number of the mechanism that can be changed: name, unit, text and start of its parameter, and
# code that puts it, as `value`, into `n`.
Tuned = tuple[str, str, str, float, str]


def fmu_model(mechanism: Mechanism, kind: str) -> Fmu:
    """The model of a kind.

    Raises: InputError: for another kind;  UnsupportedError: for a mechanism that C export has not.
    """
    if kind not in KINDS:
        raise InputError(f'kind: no FMU "{kind}".{did_you_mean(kind, KINDS)}')
    tangents = [f"{question}{TANGENT}" for question in KINDS[kind] if kind not in ROUGH]
    e = export(mechanism, [*KINDS[kind], *tangents], constants="struct", lanes=0)
    plant, calls = kind == "plant", [e[question] for question in KINDS[kind]]
    arrays = {a.name: a for f in calls for a in f.arguments}
    states, rates = (STATES, RATES) if plant else ((), ())
    if plant:
        arrays["dq"] = replace(arrays["q1"], name="dq", given=False, text="rates of q")
    # A result of one function that another takes stands once: the acceleration of `motion`.
    made = [name for name in arrays if name in {a.name for f in calls for a in f.outputs}]
    taken = {*states, *rates, "q2"} if plant else set()
    given = [name for name, a in arrays.items() if a.given and name not in taken]
    variables: list[FmuVariable] = []
    places: dict[str, int] = {}

    def add(role: str, names: Iterable[str]) -> None:
        for name in names:
            places[name] = len(variables)
            variables.extend(_scalars(e, arrays[name], role, len(variables)))

    def add_scalar(role: str, name: str, unit: str, text: str, start: float | None = None) -> None:
        places[name] = len(variables)
        variables.append(FmuVariable(name, role, unit, text, len(variables), start))

    add("input", [name for name in given if name not in PARAMETERS])
    add("parameter", [name for name in given if name in PARAMETERS])
    tuned = list(_tuned(mechanism, e))
    for t in tuned:
        add_scalar("parameter", *t[:4])
    if plant:
        add_scalar("parameter", "tolerance", "1", "error tolerance of a step", TOLERANCE)
    add("state", states)
    add_scalar("output", "status", "1", CODES)
    add("rate", rates)
    add("output", [name for name in made if name not in rates])
    order = places["status"] - places["q"] if plant else 0
    for i in range(order):
        rate = places["dq"] + i
        variables[rate] = replace(variables[rate], of=places["q"] + i)
    body = _evaluate(e, kind, places) + _prepare(e, tuned, places) + _takes(places)
    if tangents:
        body += _evaluate(e, kind, places, TANGENT)
    macros = {
        "VALUES": len(variables),
        "COMPUTED": places["status"],
        "STATUS": places["status"],
        "DIRECTIONAL": int(bool(tangents)),
        "TUNED": places[tuned[0][0]],
        "TUNED_END": places.get("q", places["status"]) if plant else places["status"],
        "ORDER": order,
        "STATES": places.get("q", 0),
        "DERIVATIVES": places.get("dq", 0),
        "TOLERANCE": places.get("tolerance", 0),
        "START": "{" + ", ".join(repr(v.start or 0.0) for v in variables) + "}",
    }
    head = "".join(f"#define MODEL_{name} {value}\n" for name, value in macros.items())
    head += f"typedef {e.prefix}_constants model_constants;\n"
    token = hashlib.sha256((e.source + head + body).encode()).hexdigest()[:32]
    return Fmu(
        name=f"{e.prefix}_{kind}",
        text=f"{TEXTS[kind]}, of {mechanism.name}",
        token=f"{{{token[:8]}-{token[8:12]}-{token[12:16]}-{token[16:20]}-{token[20:]}}}",
        variables=tuple(variables),
        order=order,
        files={f"{e.prefix}.c": e.source, f"{e.prefix}.h": e.header},
        head=f'#include "{e.prefix}.c"\n\n{head}\n{body}',
        differentiable=bool(tangents),
    )


def _scalars(e: Exported, a: CArray, role: str, first: int) -> Iterable[FmuVariable]:
    for i, (label, unit) in enumerate(zip(a.labels, a.units, strict=True)):
        start = STARTS.get(a.name, 0.0) if role in ("input", "parameter", "state") else None
        name = f"{a.name}.{e.names.get(label) or identifier(label)}"
        yield FmuVariable(name, role, unit, f"{a.text}: {label}", first + i, start)


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


def _takes(places: dict[str, int]) -> str:
    """Whether a variable takes a value: masses and inertias are positive, those of bodies of chains
    and friction may be 0."""
    never = ("tolerance", "platform.mass", *(f"platform.inertia.{i * 2}" for i in "xyz"))
    own = (key for family in FAMILIES.values() for key in family.tuned)
    start = tuple(f"{key}." for key in (*own, "viscous", "coulomb"))
    cases = {"> 0.0": [i for name, i in places.items() if name in never]}
    cases[">= 0.0"] = [i for name, i in places.items() if name.startswith(start)]
    lines = ["static int model_takes(uint32_t which, double value)", "{", "    switch (which) {"]
    for bound, found in cases.items():
        if found:
            lines += [f"    case {i}:" for i in found]
            lines[-1] += f" return value {bound} && value < HUGE_VAL;"
    return "\n".join([*lines, "    default: return 1;", "    }", "}", "", ""])


def _evaluate(e: Exported, kind: str, places: dict[str, int], suffix: str = "") -> str:
    """Everything computed, in v; or with a suffix how it changes along d."""
    name, to = ("differentiate", "d") if suffix else ("evaluate", "v")
    given = ", const double *v, double *d" if suffix else ", double *v"
    lines = [f"static int model_{name}(const model_constants *of{given})", "{"]
    if kind == "plant":
        m = len(e["forward"].inputs[0].labels)
        size = f"{m} * sizeof *v"
        lines += [f"    memcpy({to} + {places['dq']}, {to} + {places['q1']}, {size});"]
    lines.append("    int status;")
    for question in KINDS[kind]:
        function = e[f"{question}{suffix}"]
        words = "of"
        for a in function.arguments:
            own = a.name.removeprefix(PREFIX) if suffix else a.name
            place = places["acceleration" if kind == "plant" and own == "q2" else own]
            words += f", {'v' if own == a.name else 'd'} + {place}"
        lines.append(
            f"    status = {function.name}({words});\n    if (status)\n        return status;"
        )
    return "\n".join([*lines, "    return 0;", "}", "", ""])


def _prepare(e: Exported, tuned: list[Tuned], places: dict[str, int]) -> str:
    lines = ["static void model_prepare(const double *v, model_constants *of)", "{"]
    lines += [f"    {e.prefix}_numbers n = {e.prefix.upper()}_NUMBERS;"]
    lines += [f"    {put.replace('value', f'v[{places[name]}]')};" for name, *_, put in tuned]
    return "\n".join([*lines, f"    {e.prefix}_prepare(&n, of);", "}", ""])
