"""Constants in a structure that a program fills: the mechanism's numbers, and what is made of them.

`numbers` are those of the mechanism file, which a calibration changes, always in double; `prepare`
computes from them, once, the `constants` that every function is given.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from ..backends.c.prepare import fixed_name, fixed_values, stores
from ..backends.c.printer import Printer
from ..graph.graph import Value
from ..graph.program import Output
from ..mechanism.surface.wall import Wall
from ..questions.file_numbers import file_numbers, numbers_of_file
from ..questions.numbers import Layout, lane_numbers, shared_numbers, tables
from ..questions.structure import walls_of
from .c_body import Places, ScalarC
from .c_context import Context
from .c_names import picked, scalar_functions
from .syntax import c_comment


def declared(c: Context) -> str:
    """Both types, the mechanism's own numbers, and `prepare`, for the header."""
    p, P, layout = c.prefix, c.prefix.upper(), _layout(c)
    lines = ["/* The numbers of the mechanism file; chains of a family in its order. */"]
    lines += ["typedef struct {"]
    for name, (_, size) in layout.parameters.items():
        if size:
            lines.append(f"    double {_at(name, size, size)}; /* {_about(c, name)} */")
    for group, (kind, count) in enumerate(c.structure.chains):
        lines.append("    struct {")
        for path, own in lane_numbers(c.structure, group).items():
            name = _at(_field(path), own.size, own.size)
            lines.append(f"        double {name}; /* {own} */")
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
    """What a shared number is, or several: as its fields of the file say."""
    own = [entry for entry in shared_numbers(c.structure, _walls(c)) if entry.name == name]
    owner = f"{tables(c.mechanism, own[0].part)[own[0].at].name}: " if own[0].part else ""
    if len(own) == 1 and not own[0].path.startswith("surface."):
        return c_comment(f"{owner}{own[0].field}")
    keys = [entry.path.rpartition(".")[2] for entry in own]
    units = [f" [{entry.field.unit}]" if entry.field.unit.unit else "" for entry in own]
    if len({*units}) == 1:
        return c_comment(f"{owner}{', '.join(keys)}{units[0]}")
    return c_comment(owner + ", ".join(k + unit for k, unit in zip(keys, units, strict=True)))


def prepared(c: Context) -> str:
    """`prepare` and what it is made of, for the source."""
    kernels = "\n".join(_prepare(c, name, printer) for name, printer in c.printers.items())
    code = f"{kernels}\n{_prepare_function(c)}"
    text = re.sub(r"\breal\b", "double", scalar_functions())
    text = re.sub(r"\bF\((\w+)\)", r"\1", re.sub(r"\bR\(([^()]*)\)", r"\1", text))
    text = picked(re.sub(r"\b(\w+)_s\b", r"\1_d", text), code)
    return f"{text}\n{code}"


class _Numbers(ScalarC):
    """Reads the numbers of the file from the structure."""

    def __init__(self, c: Context) -> None:
        program = file_numbers(c.structure, _walls(c))
        super().__init__(program, Places((), {}, c.numbers.order), "double")
        self._families, layout = c.structure.families, _layout(c)
        self._shared = _members(layout.parameters)
        self._lanes = [_members({_field(p): at for p, at in lane.items()}) for lane in layout.lanes]

    def parameter(self, i: int) -> str:
        return f"numbers->{self._shared[i]}"

    def lane_number(self, group: int, i: int) -> str:
        return f"numbers->{self._families[group]}[i].{self._lanes[group][i]}"


def _members(slots: Mapping[str, tuple[int, int]]) -> list[str]:
    """Members of a structure in C, entry by entry."""
    return [_at(name, size, i) for name, (_, size) in slots.items() for i in range(size)]


def _prepare_function(c: Context) -> str:
    """`prepare`: the file's numbers to the kernel's, and these to constants."""
    printer, layout, p = _Numbers(c), Layout.of(c.structure), c.prefix
    shared, each = layout.sizes
    names = [f"lane_{group}" for group in range(len(each))]
    counts = zip(names, each, c.structure.counts, strict=True)
    sizes = ", ".join(f"{name}[{size} * {count}]" for name, size, count in counts)
    return "\n".join(
        [
            f"void {p}_prepare(const {p}_numbers *numbers, {p}_constants *constants)",
            "{",
            f"    double par[{shared}], {sizes};",
            f"    const double *const lane[] = {{{', '.join(names)}}};",
            *(f"  {line}" for line in fixed_values(printer, "_d")),
            *(
                f"    {line}"
                for o in printer.program.outputs
                for line in _stored(printer, layout, o)
            ),
            *(f"    prepare_{name}(par, lane, constants->{name});" for name in c.printers),
            "}",
            "",
        ]
    )


def _stored(printer: Printer, layout: Layout, o: Output) -> Iterator[str]:
    """Statements that put a number of the kernel's where it is read."""
    if not o.lanes:
        start, _ = layout.parameters[o.name]
        for i, (v,) in enumerate(o.entries):
            assert v is not None
            yield f"par[{start + i}] = {fixed_name(printer, v)};"
        return
    name, _, number = o.name.rpartition("_")
    group = int(number)
    start, count = layout.lanes[group][name][0], printer.counts[group]
    for i, entry in enumerate(o.entries):
        value: Value | None = entry[group]
        assert value is not None
        loop = f"for (int i = 0; i < {count}; i++)"
        yield f"{loop} lane_{group}[{start + i} * {count} + i] = {fixed_name(printer, value)};"


def _prepare(c: Context, name: str, printer: Printer) -> str:
    """As the kernels have it."""
    head = (
        f"static void prepare_{name}"
        f"(const double *par, const double *const *lane, {c.precision} *table) {{"
    )
    lines = [head, "  (void)par, (void)lane, (void)table;", *fixed_values(printer, "_d")]
    return "\n".join([*lines, *stores(printer, f"({c.precision})"), "}", ""])


def _initialiser(c: Context) -> list[str]:
    layout = _layout(c)
    numbers = numbers_of_file(c.mechanism, c.structure, _walls(c), c.landmark)
    (own,) = numbers.parameters
    rows = [_values(own[at : at + size]) for at, size in layout.parameters.values() if size]
    for lane, (values,) in zip(layout.lanes, numbers.lanes, strict=True):
        chains = []
        for own in values.T:
            fields = [_values(own[start : start + size]) for start, size in lane.values()]
            chains.append(f"{{{', '.join(fields)}}}")
        rows.append("{" + ", \\\n     ".join(chains) + "}")
    return [*(f"{row}," for row in rows[:-1]), rows[-1]]


def _layout(c: Context) -> Layout:
    """The layout of the numbers of the file."""
    return Layout.of_file(c.structure, _walls(c))


def _walls(c: Context) -> tuple[Wall, ...]:
    return walls_of(c.mechanism, c.structure)


def _values(numbers: object) -> str:
    values = [repr(float(x)) for x in numbers]  # type: ignore[attr-defined]
    return values[0] if len(values) == 1 else f"{{{', '.join(values)}}}"


def _field(path: str) -> str:
    """A field of a chain in C: `joint` is the joint on the platform, that of the crank its tip."""
    return "joint" if path == "platform" else path.replace(".", "_")


def _at(name: str, size: int, i: int) -> str:
    return name if size == 1 else f"{name}[{i}]"
