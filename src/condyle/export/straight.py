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
    given = [a for a in arguments if a.given]
    parameters, p = c.parameters(arguments), c.prefix.upper()
    public = f"int {c.prefix}_{name}({parameters})"
    scalar = Scalar(c.floats(program), _places(c, program, arguments, zero), c.precision)
    judged = c.judged(scalar, doubts, given)
    if quick is None or not c.lanes:
        return Body(_text(c, scalar, public, name, judged), operations(scalar))
    plain = f"static int {c.prefix}_{name}_plain({parameters})"
    code = _text(c, scalar, plain, name, judged)
    vector = Wide(c.floats(quick), _places(c, quick, arguments, zero), c.lanes)
    head = f"static int {c.prefix}_{name}_quick({parameters})"
    wide = _text(c, vector, head, f"{name}_quick", c.judged(vector, doubts, given))
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


def _text(c: Context, body: Scalar | Wide, head: str, table: str, judged: str) -> str:
    p = c.prefix.upper()
    lines = [head, "{", c.table(table, body), *(f"    {line}" for line in body.lines()), judged]
    lines += [f"    if (status == {p}_OK) {{", *(f"        {line}" for line in body.stores())]
    return "\n".join([*(line for line in lines if line), "    }", "    return status;", "}", ""])
