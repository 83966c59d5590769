"""CasADi's expressions, read into a graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from ..errors import UnsupportedError
from .graph import Graph, Value
from .operations import BY_CASADI


def read(graph: Graph, outputs: Sequence[ca.SX], known: Mapping[str, Value]) -> list[list[Value]]:
    """Nodes of expressions, entry by entry.

    Args: known: symbol name -> node, for every symbol that occurs.
    """
    free = ca.symvar(ca.veccat(*outputs))
    function = ca.Function("expressions", [ca.vertcat(*free)], [ca.densify(o) for o in outputs])
    names = [symbol.name() for symbol in free]
    work: dict[int, Value] = {}
    entries: list[list[Value]] = [[-1] * o.numel() for o in outputs]
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        ins, outs = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_CONST:
            work[outs[0]] = graph.const(function.instruction_constant(k))
        elif op == ca.OP_INPUT:
            work[outs[0]] = known[names[ins[1]]]
        elif op == ca.OP_OUTPUT:
            entries[outs[0]][outs[1]] = work[ins[0]]
        else:
            work[outs[0]] = _operation(graph, op, [work[i] for i in ins])
    return entries


def _operation(graph: Graph, op: int, args: list[Value]) -> Value:
    if op in (ca.OP_CONSTPOW, ca.OP_POW):
        exponent = graph.nodes[args[1]]
        if exponent.op == "const" and exponent.data[0] in (2.0, 3.0, 4.0):
            square = graph.apply("mul", args[0], args[0])
            if exponent.data[0] == 2.0:
                return square
            return graph.apply("mul", square, args[0] if exponent.data[0] == 3.0 else square)
    if op in BY_CASADI:
        return graph.apply(BY_CASADI[op], *args)
    if op == ca.OP_SQ:
        return graph.apply("mul", args[0], args[0])
    if op == ca.OP_TWICE:
        return graph.apply("add", args[0], args[0])
    if op == ca.OP_INV:
        return graph.apply("div", graph.const(1.0), args[0])
    if op == ca.OP_ASSIGN:
        return args[0]
    raise UnsupportedError(f"CasADi's operation number {op} is not in the table of operations")
