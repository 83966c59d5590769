"""One question as one C function without a loop."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..backends.c.printer import nested
from ..errors import UnsupportedError
from ..graph.program import Program
from ..mechanism.chain import limits
from ..mechanism.mechanism import Mechanism
from ..questions.friction import MOST
from .c_body import HUGE, Places, Scalar, Wide
from .c_context import CODES, Body, Context
from .c_precision import ANGLES, LARGEST, threshold
from .catalogue import Entry, Wish
from .exported import Argument

NAMES = {int(code): name for name, code in CODES.items()}
# Ports that are numbers of the mechanism: limits, and by what efforts are measured.
LIMITS = ("low", "high", "scale", "contact_low", "contact_high")


def renamed(words: str) -> dict[str, str]:
    """Ports or results -> names in C, of an entry."""
    return {pair[0]: pair[-1] for pair in (word.split(">") for word in words.split())}


def function(c: Context, name: str, entry: Entry, wish: Wish) -> tuple[tuple[Argument, ...], Body]:
    """A function that judges its samples, and writes results of good ones alone.

    Raises: UnsupportedError: where efforts with friction have no closed form.
    """
    if entry.rubbing == "UNCERTIFIED" and len(c.structure.friction) > MOST:
        raise UnsupportedError(
            f"friction at {len(c.structure.friction)} contacts has no efforts in closed form; at "
            f"most {MOST} have"
        )
    if entry.question == "limited" and c.precision != "double":
        raise UnsupportedError("efforts within limits are exported in double alone")
    found = c.variants(entry.question or name, *entry.details(wish))
    results = renamed(entry.results)
    program = _pruned(found.robust or found.main, results)
    given = renamed(entry.given or " ".join(_used(program)))
    arguments = tuple(_arguments(c, entry, program, given, results))
    parameters, p = c.parameters(arguments), c.prefix.upper()
    public = f"int {c.prefix}_{name}({parameters})"
    scalar = Scalar(c.floats(program, name), _places(c, program, given, arguments), c.precision)
    cost, statuses = (
        scalar.operations,
        tuple(dict.fromkeys(status for *_, status in _judged(c, entry, scalar, arguments))),
    )
    if not (entry.quick and c.lanes):
        code = _text(c, entry, scalar, public, name, arguments)
        return arguments, Body(code, cost, statuses)
    plain = f"static int {c.prefix}_{name}_plain({parameters})"
    code = _text(c, entry, scalar, plain, name, arguments)
    # With fewer steps in a row; samples that it cannot vouch for go to `program`.
    latency = _pruned(found.latency or found.main, results)
    vector = Wide(c.floats(latency, name), _places(c, latency, given, arguments), c.lanes)
    head = f"static int {c.prefix}_{name}_quick({parameters})"
    wide = _text(c, entry, vector, head, f"{name}_quick", arguments)
    words = [a.name for a in arguments]
    sure, slow = (c.call(f"{c.prefix}_{name}_{how}", words) for how in ("quick", "plain"))
    dispatch = f"""{public}
{{
#if defined({p}_VECTOR)
    if ({sure} == {p}_OK) return {p}_OK;
#endif
    return {slow};
}}
"""
    return arguments, Body(code, cost, statuses, wide, dispatch)


def _pruned(program: Program, results: Mapping[str, str]) -> Program:
    """What the wanted results need, and its checks."""
    return replace(program, outputs=tuple(o for o in program.outputs if o.name in results))


def _used(program: Program) -> list[str]:
    """Ports that results depend on."""
    nodes = (program.graph.nodes[v] for v in program.order)
    columns = {n.data[-1] for n in nodes if n.op in ("input", "lane_input")}
    lanes = sum(program.counts)
    return [
        port.name
        for port in program.ports
        if columns & set(range(port.start, port.start + port.size * (lanes if port.lanes else 1)))
        and port.name not in LIMITS
    ]


def _arguments(
    c: Context,
    entry: Entry,
    program: Program,
    given: Mapping[str, str],
    results: Mapping[str, str],
) -> list[Argument]:
    ports = {port.name: port for port in program.ports}
    there = {result.name: result for result in program.interface.results}
    found = [
        c.arguments.argument(name, ports[port], True, entry.told.get(name))
        for port, name in given.items()
    ]
    found += [
        c.arguments.argument(name, there[result], False, entry.told.get(name))
        for result, name in results.items()
        if result in there
    ]
    return [a for a in found if a.size]


def _places(
    c: Context, program: Program, given: Mapping[str, str], arguments: Sequence[Argument]
) -> Places:
    """Where numbers are; of ports without an argument, or beyond its end, what they are."""
    sizes = {a.name: a.size for a in arguments if a.given}
    known, huge = own_numbers(c.mechanism), HUGE[c.precision]
    suffix = "" if c.precision == "double" else "f"

    def place(port: str, i: int) -> str:
        name, value = given.get(port, ""), 0.0
        if i < sizes.get(name, 0):
            return f"{name}[{i}]"
        if port in known:
            value = max(-huge, min(huge, known[port][i]))
        return f"({value!r}{suffix})"

    results = {a.port: a.name for a in arguments if not a.given}
    return Places.of(program.interface, c.numbers.order, place, results)


def own_numbers(mechanism: Mechanism) -> dict[str, list[float]]:
    """Numbers of the ports `LIMITS`, in their order."""
    low, high = zip(*(limits(chain)[:2] for chain in mechanism.chains), strict=True)
    push = [contact.push if contact.one_sided else 0 for contact in mechanism.contacts]
    least = [0.0 if side > 0 else -math.inf for side in push]
    most = [0.0 if side < 0 else math.inf for side in push]
    rows = low, high, [1.0] * len(low), least, most
    return {name: list(row) for name, row in zip(LIMITS, rows, strict=True)}


def _judged(
    c: Context, entry: Entry, body: Scalar | Wide, arguments: Sequence[Argument]
) -> list[tuple[str, str, str]]:
    """What decides on a sample, in turn: a value, what it must not break, and the status else."""
    given = [a for a in arguments if a.given]
    every = [f"fabs_s({a.name}[{i}])" for a in given for i in range(a.size)]
    angles = [
        f"fabs_s({a.name}[{i}])" for a in given for i, unit in enumerate(a.units) if unit == "rad"
    ]
    found = [(_sum(every), f"<= {body.number(LARGEST[c.precision])}", "OUT_OF_BOUNDS")]
    if angles and isinstance(body, Scalar):  # vector code takes far angles from the library
        found.append((_sum(angles), f"<= {body.number(ANGLES[c.precision])}", "OUT_OF_BOUNDS"))
    for i, check in enumerate(body.program.checks):
        limit = body.number(threshold(check.tolerance, c.precision))
        known = NAMES[int(check.below)] if check.below is not None else entry.unsure(c.structure)
        found.append((body.check(i), f">= {limit}", known))
    for store in body.stores() if entry.within else ():
        place, value = store.rstrip(";").split(" = ", 1)
        if bound := entry.within.get(place.partition("[")[0]):
            limit = body.number(bound[c.precision])
            found.append((nested("fmax_s", [value, f"-{value}"]), f"<= {limit}", "INFEASIBLE"))
    return found


def _sum(terms: Sequence[str]) -> str:
    """Two halves side by side, which wait less for each other."""
    if len(terms) == 1:
        return terms[0]
    half = len(terms) // 2
    return f"({_sum(terms[:half])} + {_sum(terms[half:])})"


def _text(
    c: Context,
    entry: Entry,
    body: Scalar | Wide,
    head: str,
    table: str,
    arguments: Sequence[Argument],
) -> str:
    """Values wait in volatile places, so that no compiler moves work behind the status, and what is
    not wanted is written aside: bad samples take the time of good ones. Vector code, for least
    latency, does without."""
    p, stores = c.prefix.upper(), list(body.stores())
    judged = _judged(c, entry, body, arguments)
    lines = [head, "{", c.table(table, body), *(f"    {line}" for line in body.lines())]
    values = [value for value, _, _ in judged]
    if isinstance(body, Scalar):
        kept = [*(store.rstrip(";").split(" = ", 1)[1] for store in stores), *values]
        lines.append(f"    volatile {c.precision} found[{len(kept)}];")
        lines += [f"    found[{i}] = {value};" for i, value in enumerate(kept)]
        values = [f"found[{len(stores) + i}]" for i in range(len(judged))]
    lines.append("    const int status =")
    for value, (_, bound, status) in zip(values, judged, strict=True):
        lines.append(f"        !({value} {bound}) ? {p}_{status} :")
    lines += [f"        {p}_OK;"]
    if isinstance(body, Scalar):
        lines.append(f"    {c.precision} aside[{len(stores)}];")
        for a in arguments:
            if not a.given:
                to = f"status == {p}_OK ? {a.name} : aside"
                lines.append(f"    {c.precision} *const {a.name}_ = {to};")
        for i, store in enumerate(stores):
            name, at = store.split(" = ", 1)[0].split("[")
            lines.append(f"    {name}_[{at} = found[{i}];")
    else:
        lines += [f"    if (status == {p}_OK) {{", *(f"        {s}" for s in stores), "    }"]
    return "\n".join(line for line in [*lines, "    return status;", "}"] if line) + "\n\n"
