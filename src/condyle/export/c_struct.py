"""Constants in a structure that a program fills: the mechanism's numbers, and what is made of them.

`numbers` are those of the mechanism file, which a calibration changes, always in double; `prepare`
computes from them, once, the `constants` that every function is given.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from ..backends.c.prepare import fixed_name, fixed_values, prepare
from ..backends.c.printer import Printer
from ..graph.graph import Value
from ..graph.program import Output
from ..questions.file_numbers import file_numbers, numbers_of_file
from ..questions.numbers import Layout
from ..questions.structure import walls_of
from .c_context import Context
from .c_function import Places, ScalarC
from .c_names import in_comment, picked, scalar_functions

FIELDS = {
    "gravity": "m/s^2, in {S}",
    "mass": "kg, of the platform",
    "com": "m, mass centre of the platform, in {M}",
    "inertia": "kg m^2, of the platform about its mass centre, in {M}: xx, yy, zz, xy, xz, yz",
    "landmark": "m, in {M}: the point whose path is given",
    "contact_point": "m, centre of the ball in {M}",
    "contact_surface": "the numbers of its surface",
    "contact_ball": "m, radius of the ball",
    "contact_home": "where the search for the touching point begins: normal at home; 0",
    "friction": "coefficient, smoothing speed [m/s]",
    "ligament_base": "m, in {S}",
    "ligament_platform": "m, in {M}",
    "ligament_slack_length": "m",
    "ligament_stiffness": "N/m, or strain and force [N] of every row",
    "ligament_damping": "N s/m",
    "wall_point": "m, in {M}",
    "wall_surface": "slope, offset [m] of its plane",
}
LANES = {
    "base": "m, in {S}: crank pivot, slider's joint at home, or base joint",
    "axis": "of the shaft or rail, in {S}; its length does not matter",
    "crank_tip": "m, at home, in {S}",
    "joint": "m, platform joint in {M}",
    "mass": "kg",
    "com": "mass centre, as in the file",
    "transverse": "kg m^2, across, about the mass centre",
    "axial": "kg m^2, along",
    "inertia": "kg m^2, about its axis",
    "gear": "turns of the motor a turn of the joint, or rad/m",
    "viscous": "N m s/rad or N s/m",
    "coulomb": "N m or N",
    "smoothing_speed": "rad/s or m/s",
    "zero": "rad or m, what the encoder reads at home",
}


def declared(c: Context) -> str:
    """Both types, the mechanism's own numbers, and `prepare`, for the header."""
    p, P, layout = c.prefix, c.prefix.upper(), _layout(c)
    lines = ["/* The numbers of the mechanism file; chains of a family in its order. */"]
    lines += ["typedef struct {"]
    for name, (_, size) in layout.parameters.items():
        if size:
            lines.append(f"    double {_at(name, size, size)}; /* {_about(c, name)} */")
    for (kind, count), lane in zip(c.structure.chains, layout.lanes, strict=True):
        lines.append("    struct {")
        for path, (_, size) in lane.items():
            name = _field(path)
            about = LANES.get(name) or LANES[path.rpartition(".")[2].removeprefix("rotor_")]
            lines.append(f"        double {_at(name, size, size)}; /* {about} */")
        lines.append(f"    }} {kind}[{count}];")
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


def _about(c: Context, name: str) -> str:
    """What a shared number is."""
    kind, _, i = name.rpartition("_")
    if name in FIELDS:
        return FIELDS[name]
    about = FIELDS[kind]
    if kind.startswith("ligament"):
        return f"{in_comment(c.mechanism.ligament_names[int(i)])}: {about}"
    if kind.startswith("wall"):
        return f"{in_comment(c.mechanism.enabled_walls[int(i)].name)}: {about}"
    contact = c.mechanism.contact_names[int(i)]
    if kind == "contact_surface":
        about += f": {', '.join(c.mechanism.contacts[int(i)].surface.numbers)}"
    return f"{in_comment(contact)}: {about}"


def prepared(c: Context) -> str:
    """`prepare` and what it is made of, for the source."""
    kernels = "\n".join(_prepare(c, name, printer) for name, printer in c.printers.items())
    code = f"{kernels}\n{_whole(c)}"
    text = re.sub(r"\breal\b", "double", scalar_functions())
    text = re.sub(r"\bF\((\w+)\)", r"\1", re.sub(r"\bR\(([^()]*)\)", r"\1", text))
    text = picked(re.sub(r"\b(\w+)_s\b", r"\1_d", text), code)
    return f"{text}\n{code}"


def _whole(c: Context) -> str:
    """`prepare`: the file's numbers to the kernel's, and these to constants."""
    program = file_numbers(c.structure, walls_of(c.mechanism, c.structure))
    layout, p = Layout.of(c.structure), c.prefix
    printer = ScalarC(program, Places((), {}, c.numbers.order), "double")
    own = _layout(c)
    shared = {
        start + i: _at(name, size, i)
        for name, (start, size) in own.parameters.items()
        for i in range(size)
    }
    lanes = [
        {start + i: _at(_field(path), size, i) for path, (start, size) in lane.items()
         for i in range(size)}
        for lane in own.lanes
    ]  # fmt: skip

    def lane_place(m: re.Match[str]) -> str:
        group = int(m[1])
        return f"numbers->{c.structure.families[group]}[i].{lanes[group][int(m[2])]}"

    text = "\n".join(f"  {line}" for line in _used(printer))
    text = re.sub(r"\bpar\[(\d+)\]", lambda m: f"numbers->{shared[int(m[1])]}", text)
    text = _in_double(re.sub(r"\blane\[(\d+)\]\[(\d+) \* \d+ \+ i\]", lane_place, text))
    counts = [f"{sum(n for _, n in lane.values())} * {count}"
              for lane, count in zip(layout.lanes, c.structure.counts, strict=True)]  # fmt: skip
    names = [f"lane_{group}" for group in range(len(counts))]
    sizes = ", ".join(f"{name}[{size}]" for name, size in zip(names, counts, strict=True))
    return "\n".join(
        [
            f"void {p}_prepare(const {p}_numbers *numbers, {p}_constants *constants)",
            "{",
            f"    double par[{sum(n for _, n in layout.parameters.values())}], {sizes};",
            f"    const double *const lane[] = {{{', '.join(names)}}};",
            text,
            *(f"    {line}" for o in program.outputs for line in _stored(c, printer, layout, o)),
            *(f"    prepare_{name}(par, lane, constants->{name});" for name in c.printers),
            "}",
            "",
        ]
    )


def _stored(c: Context, printer: Printer, layout: Layout, o: Output) -> Iterator[str]:
    """Statements that put a number of the kernel's where it is read."""
    if not o.lanes:
        start, _ = layout.parameters[o.name]
        for i, (v,) in enumerate(o.entries):
            assert v is not None
            yield f"par[{start + i}] = {fixed_name(printer, v)};"
        return
    name, _, number = o.name.rpartition("_")
    group = int(number)
    start, count = layout.lanes[group][name][0], c.structure.counts[group]
    for i, entry in enumerate(o.entries):
        value: Value | None = entry[group]
        assert value is not None
        loop = f"for (int i = 0; i < {count}; i++)"
        yield f"{loop} lane_{group}[{start + i} * {count} + i] = {fixed_name(printer, value)};"


def _prepare(c: Context, name: str, printer: Printer) -> str:
    """As the kernels have it."""
    text = prepare(printer, f"prepare_{name}").replace("HIDDEN void", "static void", 1)
    defined = "\n".join(fixed_values(printer))
    text = _in_double(text.replace(defined, "\n".join(_used(printer))))
    text = re.sub(r"(table\[[^\]]*\]) = ([^;]+);", rf"\1 = ({c.precision})\2;", text)
    text = text.replace("double *table)", f"{c.precision} *table)", 1)
    return text.replace("{", "{\n  (void)par, (void)lane, (void)table;", 1)


def _used(printer: Printer) -> list[str]:
    """Definitions of fixed values but of numbers, which stand where they are used."""
    nodes = printer.g.nodes
    known = {f"  const double x{v} = " for v in printer.fixed if nodes[v].op == "const"}
    return [line for line in fixed_values(printer) if line.partition("= ")[0] + "= " not in known]


def _in_double(text: str) -> str:
    return re.sub(r"\b(\w+)_s\(", r"\1_d(", text)


def _initialiser(c: Context) -> list[str]:
    layout, walls = _layout(c), walls_of(c.mechanism, c.structure)
    numbers = numbers_of_file(c.mechanism, c.structure, walls, c.landmark)
    own = numbers.parameters
    rows = [_values(own[at : at + size]) for at, size in layout.parameters.values() if size]
    for lane, values in zip(layout.lanes, numbers.lanes, strict=True):
        chains = []
        for own in values.T:
            fields = [_values(own[start : start + size]) for start, size in lane.values()]
            chains.append(f"{{{', '.join(fields)}}}")
        rows.append("{" + ", \\\n     ".join(chains) + "}")
    return [*(f"{row}," for row in rows[:-1]), rows[-1]]


def _layout(c: Context) -> Layout:
    """Of the numbers of the file."""
    return Layout.of_file(c.structure, walls_of(c.mechanism, c.structure))


def _values(numbers: object) -> str:
    values = [repr(float(x)) for x in numbers]  # type: ignore[attr-defined]
    return values[0] if len(values) == 1 else f"{{{', '.join(values)}}}"


def _field(path: str) -> str:
    """A field of a chain in C: `joint` is the joint on the platform, that of the crank its tip."""
    return "joint" if path == "platform" else path.replace(".", "_")


def _at(name: str, size: int, i: int) -> str:
    return name if size == 1 else f"{name}[{i}]"
