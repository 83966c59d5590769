"""What an FMU is of a mechanism, in C: its variables, and how they follow from each other.

Three kinds: the `plant` (efforts and a load in, motion out), the `inverse` model (a motion in,
efforts out) and the `controller` (computed torque). Every array of the exported functions is a row
of scalar variables, called as array and label: `effort.masseter_left`, `q.X`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, replace

from ..errors import InputError, did_you_mean
from ..kinematics.chain import FAMILIES
from ..mechanism import Mechanism
from .c_names import identifier
from .c_source import export
from .exported import Argument, Exported

KINDS = {
    "plant": ("forward", "motion"),
    "inverse": ("contact",),
    "controller": ("computed_torque",),
}
TEXTS = {
    "plant": "Forward dynamics: efforts and a load in, motion and contact forces out",
    "inverse": "Inverse dynamics: a motion and a load in, efforts and contact forces out",
    "controller": "Computed torque: wanted and measured motion in, efforts out",
}
STATES, RATES = ("q", "q1"), ("dq", "acceleration")
PARAMETERS = ("point", "kp", "kd")
STARTS = {"kp": 400.0, "kd": 40.0}
TOLERANCE = 1e-9  # of a step of the plant, relative and absolute


@dataclass(frozen=True)
class Scalar:
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
    """kind; variables in the order of their references; C of all of it, without the interface."""

    kind: str
    name: str
    text: str
    token: str
    variables: tuple[Scalar, ...]
    order: int
    files: dict[str, str]
    head: str


@dataclass(frozen=True)
class Tuned:
    """A number of the mechanism that can be changed: `code` puts it, as `value`, into `n`."""

    name: str
    unit: str
    text: str
    start: float
    code: str


def fmu_model(mechanism: Mechanism, kind: str) -> Fmu:
    """The model of a kind.

    Raises: InputError: for another kind;  UnsupportedError: for what cannot be exported to C.
    """
    if kind not in KINDS:
        raise InputError(f'there is no FMU "{kind}".{did_you_mean(kind, KINDS)}')
    e = export(mechanism, KINDS[kind], constants="struct", lanes=0)
    plant = kind == "plant"
    calls = [e[question] for question in KINDS[kind]]
    arrays = {a.name: a for f in calls for a in f.arguments}
    # A result of one function that another takes stands once: the acceleration of `motion`.
    made = {a.name for f in calls for a in f.outputs}
    if plant:
        arrays["dq"] = replace(arrays["q1"], name="dq", given=False, text="rates of q")
    rows: dict[str, list[Scalar]] = {}
    variables: list[Scalar] = []

    def add(role: str, names: Iterable[str]) -> None:
        for name in names:
            found = list(_scalars(e, arrays[name], role, len(variables)))
            rows[name] = found
            variables.extend(found)

    states = [n for n in STATES if plant]
    rates = [n for n in RATES if plant]
    taken = {*states, *rates, "q2"} if plant else set()
    given = [n for n, a in arrays.items() if a.given and n not in taken]
    add("input", [n for n in given if n not in PARAMETERS])
    add("parameter", [n for n in given if n in PARAMETERS])
    tuned = list(_tuned(mechanism, e))
    first = len(variables)
    variables += [
        Scalar(t.name, "parameter", t.unit, t.text, first + i, t.start) for i, t in enumerate(tuned)
    ]
    if plant:
        variables.append(
            Scalar("tolerance", "parameter", "1", "of a step", len(variables), TOLERANCE)
        )
    add("state", states)
    computed = len(variables)
    codes = (
        "0 ok, 1 unreachable, 2 singular, 3 out of bounds, 4 infeasible, 5 jammed, 6 uncertified"
    )
    variables.append(Scalar("status", "output", "1", codes, computed))
    add("rate", rates)
    add("output", [n for n in arrays if n in made and n not in rates])
    for state, rate in zip(states, rates, strict=True):
        for x, dx in zip(rows[state], rows[rate], strict=True):
            variables[dx.index] = replace(dx, of=x.index)
    order = sum(len(rows[s]) for s in states)
    places = {name: scalars[0].index for name, scalars in rows.items()}
    body = _evaluate(e, kind, places) + _prepare(e, tuned, first)
    macros = {
        "VALUES": len(variables),
        "COMPUTED": computed,
        "STATUS": computed,
        "ORDER": order,
        "STATES": places.get("q", 0),
        "DERIVATIVES": places.get("dq", 0),
        "TOLERANCE": next((v.index for v in variables if v.name == "tolerance"), 0),
        "START": "{" + ", ".join(repr(v.start or 0.0) for v in variables) + "}",
    }
    head = "".join(f"#define MODEL_{name} {value}\n" for name, value in macros.items())
    head += f"typedef {e.prefix}_constants model_constants;\n"
    token = hashlib.sha256((e.source + head + body).encode()).hexdigest()[:32]
    return Fmu(
        kind=kind,
        name=f"{e.prefix}_{kind}",
        text=f"{TEXTS[kind]}, of {mechanism.name}",
        token=f"{{{token[:8]}-{token[8:12]}-{token[12:16]}-{token[16:20]}-{token[20:]}}}",
        variables=tuple(variables),
        order=order,
        files={f"{e.prefix}.c": e.source, f"{e.prefix}.h": e.header},
        head=f'#include "{e.prefix}.c"\n\n{head}\n{body}',
    )


def _scalars(e: Exported, a: Argument, role: str, first: int) -> Iterable[Scalar]:
    for i, (label, unit) in enumerate(zip(a.labels, a.units, strict=True)):
        start = STARTS.get(a.name, 0.0) if role in ("input", "parameter", "state") else None
        name = f"{a.name}.{e.names.get(label) or identifier(label)}"
        yield Scalar(name, role, unit, f"{a.text}: {label}", first + i, start)


def _tuned(mechanism: Mechanism, e: Exported) -> Iterable[Tuned]:
    """Gravity, the platform's mass and inertia, and what stands for itself of the chains."""
    header, platform = e.header, mechanism.platform
    if "double gravity[3]" in header:
        for i, axis in enumerate("xyz"):
            start = float(mechanism.gravity[i])
            yield Tuned(f"gravity.{axis}", "m/s^2", f"gravity along {axis} of {{S}}", start,
                        f"n.gravity[{i}] = value")  # fmt: skip
    # The numbers hold the chains' masses that move with the platform's joints as well.
    for field, lumped in (("mass", "lumped_mass"), ("inertia", "lumped_inertia")):
        found = next((f for f in (lumped, field) if f"double {f};" in header or
                      f"double {f}[" in header), None)  # fmt: skip
        if found is None:
            continue
        if field == "mass":
            yield Tuned("platform.mass", "kg", "mass of the platform", platform.mass,
                        f"n.{found} += value - {platform.mass!r}")  # fmt: skip
            continue
        for i, key in enumerate(("xx", "yy", "zz", "xy", "xz", "yz")):
            start = float(getattr(platform.inertia, key))
            yield Tuned(f"platform.inertia.{key}", "kg m^2", f"inertia {key} of the platform",
                        start, f"n.{found}[{i}] += value - {start!r}")  # fmt: skip
    seen: dict[str, int] = {}
    for chain in mechanism.chains:
        number = seen.setdefault(chain.kind, 0)
        seen[chain.kind] += 1
        name, at = e.names[chain.name], f"n.{chain.kind}[{number}]"
        if chain.kind == "RSS":
            yield Tuned(f"crank_inertia.{name}", "kg m^2", f"of the crank of {chain.name}",
                        chain.crank.inertia, f"{at}.crank = value")  # fmt: skip
        if chain.kind == "PSS":
            yield Tuned(f"slider_mass.{name}", "kg", f"of the slider of {chain.name}",
                        chain.slider.mass, f"{at}.slider = value")  # fmt: skip
        if "double actuator[4]" in header:
            family, actuator = FAMILIES[chain.kind], chain.actuator
            unit = f"{family.effort_unit} s/{family.joint_unit}"
            yield Tuned(f"viscous.{name}", unit, f"friction of {chain.name}",
                        actuator.viscous, f"{at}.actuator[1] = value")  # fmt: skip
            yield Tuned(f"coulomb.{name}", family.effort_unit, f"friction of {chain.name}",
                        actuator.coulomb, f"{at}.actuator[2] = value")  # fmt: skip


def _evaluate(e: Exported, kind: str, places: dict[str, int]) -> str:
    lines = ["static int model_evaluate(const model_constants *of, double *v)", "{"]
    if kind == "plant":
        m = len(e["forward"].inputs[0].labels)
        size = f"{m} * sizeof *v"
        lines += [f"    memcpy(v + {places['dq']}, v + {places['q1']}, {size});"]
    lines.append("    int status;")
    for question in KINDS[kind]:
        function = e[question]
        names = ["acceleration" if kind == "plant" and a.name == "q2" else a.name
                 for a in function.arguments]  # fmt: skip
        words = ", ".join(["of", *(f"v + {places[name]}" for name in names)])
        lines += [
            f"    status = {function.name}({words});",
            "    if (status)",
            "        return status;",
        ]
    return "\n".join([*lines, "    return 0;", "}", "", ""])


def _prepare(e: Exported, tuned: list[Tuned], first: int) -> str:
    lines = ["static void model_prepare(const double *v, model_constants *of)", "{"]
    lines += [f"    {e.prefix}_numbers n = {e.prefix.upper()}_NUMBERS;"]
    for i, one in enumerate(tuned):
        lines.append(f"    {one.code.replace('value', f'v[{first + i}]')};")
    lines += [f"    {e.prefix}_prepare(&n, of);", "}", ""]
    return "\n".join(lines)
