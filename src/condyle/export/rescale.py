"""A program for another precision: the same operations, with that precision's thresholds."""

from __future__ import annotations

from ..graph.graph import Graph, Value
from ..graph.program import Program
from .exported import Precision
from .precision import threshold


def rescaled(program: Program, precision: Precision) -> Program:
    """The program, where constants that rounding decides are those of `precision`."""
    if precision == "double":
        return program
    graph = Graph()
    moved: dict[Value | None, Value] = {}
    for v in program.order:
        node = program.graph.nodes[v]
        if node.op == "const":
            moved[v] = graph.const(threshold(float(node.data[0]), precision))  # type: ignore[arg-type]
        else:
            moved[v] = graph.copy(node, tuple(moved[a] for a in node.args))
    return program.moved(graph, moved)
