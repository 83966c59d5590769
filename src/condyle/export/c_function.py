"""One question as one C function, which judges its samples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..backends.c.printer import nested
from ..backends.c.straight_line import HUGE
from ..errors import UnsupportedError
from ..graph.program import Program
from ..kinematics.rotation import NEAR_LOCK
from ..mechanism.chain import limits, require_fixed_limits
from ..mechanism.mechanism import Mechanism
from ..questions import Question
from ..questions.derivative import PREFIX, directional
from ..questions.friction import MOST
from ..questions.observer import ERROR
from ..questions.precision import threshold
from .c_body import Places, ScalarC, Wide
from .c_context import ANGLES, CODES, LARGEST, WHY, Context, FunctionBody
from .c_small import SmallC
from .catalogue import CEntry, Wish, least_norm
from .exported import CArray, Function

NAMES = {int(code): name for name, code in CODES.items()}
# Ports that are numbers of the mechanism: limits, and by what efforts are measured.
LIMITS = ("low", "high", "scale", "contact_low", "contact_high")


def renamed(words: str) -> dict[str, str]:
    """Ports or results -> names in C, of an entry."""
    return {pair[0]: pair[-1] for pair in (word.split(">") for word in words.split())}


def function(c: Context, name: str, entry: CEntry, wish: Wish) -> FunctionBody:
    """A function that judges its samples, and writes results of good ones alone.

    Raises: UnsupportedError: where efforts with friction have no closed form.
    """
    results = renamed(entry.results)
    if entry.rubbing and "effort" in results.values() and len(c.structure.friction) > MOST:
        raise UnsupportedError(
            f"friction at {len(c.structure.friction)} contacts has no efforts in closed form; at "
            f"most {MOST} have"
        )
    if entry.question == "limited":
        m = c.mechanism
        require_fixed_limits(m.chains, "export of efforts within limits", m.enabled_walls)
    if entry.question == "limited" and c.precision != "double":
        raise UnsupportedError("efforts within limits are exported in double alone")
    question = Question.about(c.structure, entry.question or name, *entry.details(wish))
    variants = question.variants()
    program = _pruned(variants.robust or variants.main, results)
    given = renamed(entry.given or " ".join(_used(program)))
    if entry.tangent:
        program = directional(program, set(given), set(results))
        given |= {PREFIX + port: PREFIX + own for port, own in given.items()}
        results = {PREFIX + result: PREFIX + own for result, own in results.items()}
    arguments = tuple(_arguments(c, entry, program, given, results))
    context = [f"const {c.prefix}_constants *constants"] * c.struct
    parameters = ", ".join([*context, *(a.declared(c.precision) for a in arguments)])
    public = f"int {c.prefix}_{name}({parameters})"
    kind = SmallC if c.small else ScalarC
    scalar = kind(
        c.floats(program, name), _places(c, entry, program, given, arguments), c.precision
    )
    text, own = entry.text, f"{c.prefix}_{name}"
    efforts = any(a.name == "effort" and not a.given for a in arguments)
    if efforts and not entry.limited and least_norm(c.mechanism):
        text += " Limits are ignored: a cable's effort may be negative."
    why = {status: WHY[status] for *_, status in _judged(c, entry, scalar, arguments)}
    made = Function(own, name, text, arguments, entry.steps, scalar.operations, why)
    if not (entry.quick and c.lanes):
        code = _text(c, entry, scalar, public, name, arguments)
        return FunctionBody(made, code)
    plain = f"static int {c.prefix}_{name}_plain({parameters})"
    code = _text(c, entry, scalar, plain, name, arguments)
    # With fewer steps in a row; samples that it cannot vouch for go to `program`.
    latency = _pruned(variants.latency or variants.main, results)
    vector = Wide(c.floats(latency, name), _places(c, entry, latency, given, arguments), c.lanes)
    head = f"static int {c.prefix}_{name}_quick({parameters})"
    vector_code = _text(c, entry, vector, head, f"{name}_quick", arguments)
    words, p = ", ".join(a.name for a in arguments), c.prefix.upper()
    dispatch = f"""{public}
{{
#if defined({p}_VECTOR)
    if ({own}_quick({words}) == {p}_OK) return {p}_OK;
#endif
    return {own}_plain({words});
}}
"""
    return FunctionBody(made, code, vector_code, dispatch)


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
        and port.name not in (*LIMITS, ERROR)
    ]


def _arguments(
    c: Context,
    entry: CEntry,
    program: Program,
    given: Mapping[str, str],
    results: Mapping[str, str],
) -> list[CArray]:
    ports = {port.name: port for port in program.ports}
    there = {result.name: result for result in program.interface.results}
    arguments = [
        c.arguments.argument(name, ports[port], True, entry.described.get(name))
        for port, name in given.items()
    ]
    arguments += [
        c.arguments.argument(name, there[result], False, entry.described.get(name))
        for result, name in results.items()
        if result in there
    ]
    return [a for a in arguments if a.size]


def _places(
    c: Context,
    entry: CEntry,
    program: Program,
    given: Mapping[str, str],
    arguments: Sequence[CArray],
) -> Places:
    """Where numbers are; of ports without an argument, or beyond its end, what they are."""
    sizes, order = {a.name: a.size for a in arguments if a.given}, c.numbers.order
    known, huge = {**own_numbers(c.mechanism), **entry.limits}, HUGE[c.precision]
    suffix = "" if c.precision == "double" else "f"

    def place(port: str, i: int) -> str:
        name, value = given.get(port, ""), 0.0
        if i < sizes.get(name, 0):
            return f"{name}[{i}]"
        if port in known:
            value = max(-huge, min(huge, known[port][i]))
        return f"({value!r}{suffix})"

    columns = []
    for port in program.ports:
        stride, lanes = (len(order), order) if port.lanes else (1, (0,))
        columns += [place(port.name, i * stride + k) for i in range(port.size) for k in lanes]
    return Places(tuple(columns), {a.port: a.name for a in arguments if not a.given}, order)


def own_numbers(mechanism: Mechanism) -> dict[str, list[float]]:
    """Numbers of the ports `LIMITS`, in their order."""
    low, high = zip(*(limits(chain)[:2] for chain in mechanism.chains), strict=True)
    push = [contact.push if contact.one_sided else 0 for contact in mechanism.contacts]
    least = [0.0 if side > 0 else -math.inf for side in push]
    most = [0.0 if side < 0 else math.inf for side in push]
    rows = low, high, [1.0] * len(low), least, most
    return {name: list(row) for name, row in zip(LIMITS, rows, strict=True)}


def _judged(
    c: Context, entry: CEntry, body: ScalarC | Wide, arguments: Sequence[CArray]
) -> list[tuple[str, str, str]]:
    """What decides on a sample, in turn: a value, what it must not break, and the status else."""
    given = [a for a in arguments if a.given]
    every = [f"fabs_s({a.name}[{i}])" for a in given for i in range(a.size)]
    if isinstance(body, SmallC):
        every = [f"sizes_s({a.name}, {a.size})" for a in given]
    angles = [
        f"fabs_s({a.name}[{i}])"
        for a in given
        for i, unit in enumerate(a.units)
        if unit == "rad" and not a.name.startswith(PREFIX)
    ]
    conditions = [(_sum(every), f"<= {body.number(LARGEST[c.precision])}", "OUT_OF_BOUNDS")]
    if angles and isinstance(body, ScalarC):  # vector code takes far angles from the library
        conditions.append((_sum(angles), f"<= {body.number(ANGLES[c.precision])}", "OUT_OF_BOUNDS"))
    nodes, doubted = body.program.graph.nodes, []
    near = threshold(NEAR_LOCK, c.precision)
    for i, check in enumerate(body.program.checks):
        judged = body.check(i), f">= {body.number(check.tolerance)}"
        if check.below is not None:
            conditions.append((*judged, NAMES[int(check.below)]))
        elif any(nodes[v].data == (near,) for v in nodes[check.value].args):
            conditions.append((*judged, "GIMBAL_LOCK"))  # which a robust path would tell
        else:
            doubted.append((*judged, entry.unsure(c.structure)))
    conditions += doubted
    for store in body.stores() if entry.within else ():
        place, value = store.rstrip(";").split(" = ", 1)
        if bound := entry.within.get(place.partition("[")[0]):
            limit = body.number(bound[c.precision])
            conditions.append((nested("fmax_s", [value, f"-{value}"]), f"<= {limit}", "INFEASIBLE"))
    return conditions


def _sum(terms: Sequence[str]) -> str:
    """Two halves side by side, which wait less for each other."""
    if len(terms) == 1:
        return terms[0]
    half = len(terms) // 2
    return f"({_sum(terms[:half])} + {_sum(terms[half:])})"


def _text(
    c: Context,
    entry: CEntry,
    body: ScalarC | Wide,
    head: str,
    table: str,
    arguments: Sequence[CArray],
) -> str:
    """Values wait in volatile places, so that no compiler moves work behind the status, and what is
    not wanted is written aside: bad samples take the time of good ones. Vector code, for least
    latency, does without."""
    p, stores = c.prefix.upper(), list(body.stores())
    judged = _judged(c, entry, body, arguments)
    lines = [head, "{", c.table(table, body), *(f"    {line}" for line in body.lines())]
    values = [value for value, _, _ in judged]
    if isinstance(body, ScalarC):
        kept = [*(store.rstrip(";").split(" = ", 1)[1] for store in stores), *values]
        lines.append(f"    volatile {c.precision} found[{len(kept)}];")
        lines += [f"    found[{i}] = {value};" for i, value in enumerate(kept)]
        values = [f"found[{len(stores) + i}]" for i in range(len(judged))]
    lines.append("    const int status =")
    for value, (_, bound, status) in zip(values, judged, strict=True):
        lines.append(f"        !({value} {bound}) ? {p}_{status} :")
    lines += [f"        {p}_OK;"]
    if isinstance(body, ScalarC):
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
