"""One question as one C function without a loop."""

from __future__ import annotations

from collections.abc import Sequence

from ..graph.program import Program
from .body import Scalar, Wide
from .context import Body, Context
from .exported import Argument
from .places import Places


def function(
    c: Context,
    name: str,
    program: Program,
    arguments: Sequence[Argument],
    doubts: Sequence[str],
    quick: Program | None = None,
    zero: Sequence[str] = (),
) -> Body:
    """A function that judges its samples, and writes results of good ones alone.

    Args: doubts: what a check that is not certain means, one a check.
          quick:  a program of fewer steps in a row for vector types; samples that it cannot vouch
                  for go to `program`.
          zero:   inputs that are 0, as a column's C is written.
    """
    given, results = ([a for a in arguments if a.given is way] for way in (True, False))
    parameters, p = c.parameters(arguments), c.prefix.upper()
    public = f"int {c.prefix}_{name}({parameters})"
    scalar = Scalar(c.floats(program), _places(c, program, arguments, zero), c.precision)
    judged = c.judged(scalar, doubts, given)
    if quick is None or not c.lanes:
        return Body(_text(c, scalar, public, name, judged, results), operations(scalar))
    plain = f"static int {c.prefix}_{name}_plain({parameters})"
    code = _text(c, scalar, plain, name, judged, results)
    vector = Wide(c.floats(quick), _places(c, quick, arguments, zero), c.lanes)
    head = f"static int {c.prefix}_{name}_quick({parameters})"
    judged = c.judged(vector, doubts, given)
    wide = _text(c, vector, head, f"{name}_quick", judged, results)
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
    return Body(code, operations(scalar), wide, dispatch)


def operations(body: Scalar) -> int:
    """Floating-point operations; a fused multiply-add counts one, sine with cosine too."""
    total = 0
    for v in body.varying:
        node = body.g.nodes[v]
        copies = 1 if node.group is None else body.counts[node.group]
        if node.op in ("sum", "least"):
            total += sum(body.counts[g] for g, _ in body.lane_terms(v)) - 1
        elif node.op not in ("input", "lane_input", "neg"):
            total += copies
    return total


def _places(
    c: Context, program: Program, arguments: Sequence[Argument], zero: Sequence[str]
) -> Places:
    ports = {a.port: a.name for a in arguments if a.given}
    results = {a.port: a.name for a in arguments if not a.given}
    places = Places.of(program.interface, c.numbers.order, ports, results)
    nothing = "0.0" if c.precision == "double" else "0.0f"
    columns = tuple(nothing if column in zero else column for column in places.columns)
    return Places(columns, results, places.order)


def _text(
    c: Context,
    body: Scalar | Wide,
    head: str,
    table: str,
    judged: Sequence[tuple[str, str, str]],
    results: Sequence[Argument],
) -> str:
    """Values wait in volatile places, so that no compiler moves work behind the status, and what is
    not wanted is written aside: bad samples take the time of good ones. Vector code, for least
    latency, does without."""
    ok, stores = f"{c.prefix.upper()}_OK", list(body.stores())
    lines = [head, "{", c.table(table, body), *(f"    {line}" for line in body.lines())]
    values = [value for value, _, _ in judged]
    if isinstance(body, Scalar):
        kept = [*(store.rstrip(";").split(" = ", 1)[1] for store in stores), *values]
        lines.append(f"    volatile {c.precision} found[{len(kept)}];")
        lines += [f"    found[{i}] = {value};" for i, value in enumerate(kept)]
        values = [f"found[{len(stores) + i}]" for i in range(len(judged))]
    lines.append("    const int status =")
    for value, (_, bound, status) in zip(values, judged, strict=True):
        lines.append(f"        !({value} {bound}) ? {status} :")
    lines += [f"        {ok};"]
    if isinstance(body, Scalar):
        lines.append(f"    {c.precision} aside[{len(stores)}];")
        for a in results:
            lines.append(f"    {c.precision} *const {a.name}_ = status == {ok} ? {a.name} : aside;")
        for i, store in enumerate(stores):
            name, at = store.split(" = ", 1)[0].split("[")
            lines.append(f"    {name}_[{at} = found[{i}];")
    else:
        lines += [f"    if (status == {ok}) {{", *(f"        {store}" for store in stores), "    }"]
    return "\n".join(line for line in [*lines, "    return status;", "}"] if line) + "\n\n"
