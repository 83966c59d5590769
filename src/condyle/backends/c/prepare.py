"""What does not change from sample to sample, as C: scalar, once a mechanism."""

from __future__ import annotations

from collections.abc import Iterator

from ...graph.graph import Value
from ...graph.operations import REDUCTIONS
from .printer import INFIX, Printer, arithmetic, nested, number


def prepare(printer: Printer, name: str) -> str:
    """`void name(par, lane, table)`: shared values once, lane ones for each chain."""
    head = f"HIDDEN void {name}(const double *par, const double *const *lane, double *table) {{"
    return "\n".join([head, *fixed_values(printer), *stores(printer), "}", ""])


def stores(printer: Printer, cast: str = "") -> Iterator[str]:
    """Statements that fill the table."""
    for v, slot in printer.table.shared.items():
        yield f"  table[{slot}] = {cast}x{v};"
    for group, slots in enumerate(printer.table.lanes):
        count = printer.padded[group]
        for v, slot in slots.items():
            at = printer.starts[group] + slot * count
            yield f"  for (int i = 0; i < {count}; i++) table[{at} + i] = {cast}x{v}[i];"


def fixed_values(printer: Printer, suffix: str = "_s") -> Iterator[str]:
    """Definitions: `x5` of a shared value, `x7[i]` of each chain's.

    Args: suffix: of the functions of a `double`.
    """
    for v in printer.fixed:
        node = printer.g.nodes[v]
        if node.op == "const":
            continue  # stands where it is used
        value = _value(printer, v, suffix)
        if node.group is None:
            yield f"  const double x{v} = {value};"
        else:
            count = printer.padded[node.group]
            yield f"  double x{v}[{count}];"
            yield f"  for (int i = 0; i < {count}; i++) x{v}[i] = {value};"


def _value(printer: Printer, v: Value, suffix: str) -> str:
    node = printer.g.nodes[v]
    if node.op == "parameter":
        return printer.parameter(*node.data)
    if node.op == "lane":
        return printer.lane_number(*node.data)
    if node.op in REDUCTIONS:
        return _reduction(printer, v, suffix)
    args = [fixed_name(printer, a) for a in node.args]
    if node.op in (*INFIX, "fma", "fnma", "neg"):
        return arithmetic(node.op, args)
    name = node.op if node.op in ("sin", "cos") else f"{node.op}{suffix}"
    return f"{name}({', '.join(args)})"


def fixed_name(printer: Printer, v: Value) -> str:
    """How a fixed value is referred to, a chain's at index i."""
    node = printer.g.nodes[v]
    if node.op == "const":
        return number(node.data[0])
    return f"x{v}" if node.group is None else f"x{v}[i]"


def _reduction(printer: Printer, v: Value, suffix: str) -> str:
    lanes = [f"x{t}[{i}]" for g, t in printer.lane_terms(v) for i in range(printer.counts[g])]
    sums = printer.g.nodes[v].op == "sum"
    shared = [
        f"{count} * {fixed_name(printer, t)}" if sums else fixed_name(printer, t)
        for count, t in printer.shared_terms(v)
    ]
    return " + ".join(lanes + shared) if sums else nested(f"fmin{suffix}", lanes + shared)
