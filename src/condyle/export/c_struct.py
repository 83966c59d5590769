"""Constants in a structure that a program fills: the mechanism's numbers, and what is made of them.

`numbers` are what a calibration changes, always in double; `prepare` computes from them, once, the
`constants` that every function is given.
"""

from __future__ import annotations

import re

from ..backends.c.prepare import prepare
from ..backends.c.printer import Printer
from ..kinematics.chain import FAMILIES
from ..questions.numbers import Layout
from .c_context import Context
from .c_names import packaged, picked

# What the shared numbers are; of contacts and chains `FIELDS` says it once for all.
FIELDS = {
    "gravity": "m/s^2, in {S}",
    "mass": "kg, of the platform",
    "first_moment": "kg m, of the platform about O_M, in {M}",
    "inertia": "kg m^2, of the platform about O_M, in {M}: xx, yy, zz, xy, xz, yz",
    "lumped_mass": "the same with the chains' masses that move with the platform's joints",
    "lumped_first_moment": "",
    "lumped_inertia": "",
    "branch": "-1 or 1: the branch of the dependent angle",
    "length": "m, the characteristic length",
    "landmark": "m, in {M}: the point whose path is given",
    "middle": "m, in {M}: between the contact points",
    "slope": "of both planes, z by x and y",
    "mean": "m, in {M}: between the contact points",
    "mean_offset": "m, mean of the planes' heights",
    "difference": "m, in {M}: first contact point less the second",
    "gap": "m, difference of the planes' heights",
}
LANES = {
    "joint": "m, platform joint in {M}",
    "constants": "the family's constants, in the order of their names",
    "actuator": "rotor inertia at the joint, viscous and Coulomb friction, smoothing speed squared",
}
ONE = "mask"  # of a lane that is a chain


def declared(c: Context) -> str:
    """Both types, the mechanism's own numbers, and `prepare`, for the header."""
    p, P = c.prefix, c.prefix.upper()
    lines = ["/* The mechanism's numbers; chains of a family in the order of the file. */"]
    lines += ["typedef struct {"]
    for name, size in _shared(c).items():
        known = FIELDS.get(name) or FIELDS.get(f"lumped_{name}", "")
        about = known or ("of its contact" if name[-1].isdigit() else "")
        lines.append(f"    double {_at(name, size, size)};{f' /* {about} */' if about else ''}")
    for group, kind in enumerate(c.structure.families):
        lines.append("    struct {")
        lines += [
            f"        double {_at(name, size, size)};"
            for name, size in _lane_fields(c, group).items()
        ]
        lines.append(f"    }} {kind}[{c.structure.counts[group]}];")
    lines += [f"}} {p}_numbers;", "", "/* What functions read: filled by prepare. */"]
    lines += ["typedef struct {"]
    for name, table in c.tables.items():
        lines.append(f"    {c.precision} {name}[{max(1, table.size)}];")
    lines += [f"}} {p}_constants;", "", f"/* The numbers of the mechanism file: {p}_numbers n ="]
    lines += [f" * {P}_NUMBERS; */", f"#define {P}_NUMBERS {{ \\"]
    lines += [f"    {row} \\" for row in _initialiser(c)]
    lines += ["}", "", "/* Constants from numbers: once, or whenever numbers have changed. */"]
    lines += [f"void {p}_prepare(const {p}_numbers *numbers, {p}_constants *constants);", ""]
    return "\n".join(lines)


def prepared(c: Context) -> str:
    """`prepare` and what it is made of, for the source."""
    code = "\n".join(_prepare(c, name, printer) for name, printer in c.printers.items())
    text = re.sub(r"\breal\b", "double", packaged("c_scalar.h"))
    text = re.sub(r"\bF\((\w+)\)", r"\1", re.sub(r"\bR\(([^()]*)\)", r"\1", text))
    text = picked(re.sub(r"\b(\w+)_s\b", r"\1_d", text), code)
    p = c.prefix
    head = f"void {p}_prepare(const {p}_numbers *numbers, {p}_constants *constants)"
    calls = [f"    prepare_{name}(numbers, constants->{name});" for name in c.printers]
    return "\n".join([text, code, head, "{", *calls, "}", ""])


def _prepare(c: Context, name: str, printer: Printer) -> str:
    """As the kernels have it, with numbers from the structure."""
    text = prepare(printer, f"prepare_{name}")
    layout = Layout.of(c.structure)
    for v in printer.fixed:
        if printer.g.nodes[v].op == "const":  # stands where it is used
            text = re.sub(rf"^  const double x{v} = .*\n", "", text, flags=re.MULTILINE)
    shared = {
        start + i: _at(name, size, i)
        for name, (start, size) in layout.parameters.items()
        for i in range(size)
    }
    text = re.sub(r"\bpar\[(\d+)\]", lambda m: f"numbers->{shared[int(m[1])]}", text)

    def lane(m: re.Match[str]) -> str:
        group, k = int(m[1]), int(m[2])
        field = _lane_places(c, group)[k]
        return "1.0" if field == ONE else f"numbers->{c.structure.families[group]}[i].{field}"

    text = re.sub(r"\blane\[(\d+)\]\[(\d+) \* \d+ \+ i\]", lane, text)
    text = re.sub(r"\b(\w+)_s\(", r"\1_d(", text)
    text = re.sub(r"(table\[[^\]]*\]) = ([^;]+);", rf"\1 = ({c.precision})\2;", text)
    head = f"static void prepare_{name}(const {c.prefix}_numbers *numbers, {c.precision} *table)"
    _, _, body = text.partition("{")
    return f"{head}\n{{\n    (void)numbers, (void)table;{body}"


def _shared(c: Context) -> dict[str, int]:
    """Shared numbers that some function reads, and their sizes."""
    layout, used = Layout.of(c.structure), set()
    for printer in c.printers.values():
        nodes = (printer.g.nodes[v] for v in printer.fixed)
        used |= {node.data[0] for node in nodes if node.op == "parameter"}
    return {
        name: size
        for name, (start, size) in layout.parameters.items()
        if used & set(range(start, start + size))
    }


def _lane_fields(c: Context, group: int) -> dict[str, int]:
    """Numbers of a chain of a group, and their sizes."""
    found: dict[str, int] = {}
    for name, (_, size) in Layout.of(c.structure).lanes[group].items():
        if name == "constants":
            found |= FAMILIES[c.structure.families[group]].shapes
        elif name != ONE:
            found[name] = size
    return found


def _lane_places(c: Context, group: int) -> list[str]:
    """C for each number of a lane."""
    places = [ONE]
    for name, size in _lane_fields(c, group).items():
        places += [_at(name, size, i) for i in range(size)]
    return places


def _initialiser(c: Context) -> list[str]:
    layout = Layout.of(c.structure)
    rows = []
    for name, size in _shared(c).items():
        start, _ = layout.parameters[name]
        rows.append(_values(c.numbers.parameters[start : start + size]))
    for group in range(len(c.structure.families)):
        chains = []
        for own in c.numbers.lanes[group].T:
            fields, at = [], 1
            for size in _lane_fields(c, group).values():
                fields.append(_values(own[at : at + size]))
                at += size
            chains.append(f"{{{', '.join(fields)}}}")
        rows.append("{" + ", \\\n     ".join(chains) + "}")
    return [*(f"{row}," for row in rows[:-1]), rows[-1]]


def _values(numbers: object) -> str:
    values = [repr(float(x)) for x in numbers]  # type: ignore[attr-defined]
    return values[0] if len(values) == 1 else f"{{{', '.join(values)}}}"


def _at(name: str, size: int, i: int) -> str:
    return name if size == 1 else f"{name}[{i}]"
