"""What does not change from sample to sample, as C: scalar, once a mechanism."""

from __future__ import annotations

from ...graph.graph import Value
from ...graph.operations import REDUCTIONS
from .printer import INFIX, Printer, arithmetic, nested, number


def prepare(printer: Printer, name: str) -> str:
    """`void name(par, lane, table)`: shared values once, lane ones for each chain."""
    padded = printer.padded
    head = f"HIDDEN void {name}(const double *par, const double *const *lane, double *table) {{"
    lines = [head, *fixed_values(printer)]
    lines += [f"  table[{slot}] = x{v};" for v, slot in printer.table.shared.items()]
    for group, slots in enumerate(printer.table.lanes):
        for v, slot in slots.items():
            at = printer.starts[group] + slot * padded[group]
            lines.append(f"  for (int i = 0; i < {padded[group]}; i++) table[{at} + i] = x{v}[i];")
    return "\n".join([*lines, "}", ""])


def fixed_values(printer: Printer) -> list[str]:
    """Definitions: `x5` of a shared value, `x7[i]` of each chain's."""
    g, padded, lines = printer.g, printer.padded, []
    for v in printer.fixed:
        group = g.nodes[v].group
        if group is None:
            lines.append(f"  const double x{v} = {_value(printer, v)};")
        else:
            lines.append(f"  double x{v}[{padded[group]}];")
            lines.append(f"  for (int i = 0; i < {padded[group]}; i++) ")
            lines[-1] += f"x{v}[i] = {_value(printer, v)};"
    return lines


def _value(printer: Printer, v: Value) -> str:
    node = printer.g.nodes[v]
    if node.op == "const":
        return number(node.data[0])
    if node.op == "parameter":
        return f"par[{node.data[0]}]"
    if node.op == "lane":
        group, k = node.data
        assert isinstance(group, int)
        return f"lane[{group}][{k} * {printer.padded[group]} + i]"
    if node.op in REDUCTIONS:
        return _reduction(printer, v)
    args = [fixed_name(printer, a) for a in node.args]
    if node.op in (*INFIX, "fma", "fnma", "neg"):
        return arithmetic(node.op, args)
    name = node.op if node.op in ("sin", "cos") else f"{node.op}_s"
    return f"{name}({', '.join(args)})"


def fixed_name(printer: Printer, v: Value) -> str:
    """How a fixed value is referred to, a chain's at index i."""
    node = printer.g.nodes[v]
    if node.op == "const":
        return number(node.data[0])
    return f"x{v}" if node.group is None else f"x{v}[i]"


def _reduction(printer: Printer, v: Value) -> str:
    lanes = [f"x{t}[{i}]" for g, t in printer.lane_terms(v) for i in range(printer.counts[g])]
    sums = printer.g.nodes[v].op == "sum"
    shared = [
        f"{count} * {fixed_name(printer, t)}" if sums else fixed_name(printer, t)
        for count, t in printer.shared_terms(v)
    ]
    return " + ".join(lanes + shared) if sums else nested("fmin_s", lanes + shared)
