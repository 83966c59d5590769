"""A program as a CasADi function of one sample: an independent way to run a graph.

For tests, for the straight-line C that kernels are measured against, and for what CasADi exports.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from condyle.graph.graph import Value
from condyle.graph.operations import BY_CASADI, REDUCTIONS
from condyle.graph.program import Numbers, Program

_NUMBER = {name: number for number, name in BY_CASADI.items() if number != ca.OP_CONSTPOW}


def casadi_function(program: Program, numbers: Numbers) -> ca.Function:
    """All input columns in one vector -> every output, (width,), lanes group by group; checks."""
    x = ca.SX.sym("x", program.columns)
    values: dict[Value, list[Any]] = {}  # one a lane, or one for all
    for v in program.order:
        node = program.graph.nodes[v]
        lanes = program.counts[node.group] if node.group is not None else 1
        if not node.args:
            values[v] = [_leaf(node.op, node.data, numbers, x, lane) for lane in range(lanes)]
        elif node.op in REDUCTIONS:
            terms = [
                term
                for a, count in zip(node.args, program.counts, strict=True)
                for term in (values[a] if len(values[a]) == count else values[a] * count)
            ]
            total = terms[0]
            for term in terms[1:]:
                total = total + term if node.op == "sum" else ca.fmin(total, term)
            values[v] = [total]
        else:
            values[v] = [
                _apply(node.op, [values[a][lane if len(values[a]) > 1 else 0] for a in node.args])
                for lane in range(lanes)
            ]
    outputs = []
    for output in program.outputs:
        entries: list[Any] = []
        for entry in output.entries:
            for group, wanted in enumerate(entry):
                if wanted is not None:
                    own, count = values[wanted], program.counts[group] if output.lanes else 1
                    entries += own if len(own) == count else own * count
        outputs.append(ca.vertcat(ca.SX(0, 1), *entries))
    checks = ca.vertcat(ca.SX(0, 1), *(values[c.value][0] for c in program.checks))
    return ca.Function("program", [x], [*outputs, checks])


def _leaf(op: str, data: tuple[Any, ...], numbers: Numbers, x: ca.SX, lane: int) -> Any:
    if op == "const":
        return ca.SX(data[0])
    if op == "input":
        return x[data[0]]
    if op == "lane_input":
        return x[data[1] + lane]
    if op == "parameter":
        return ca.SX(float(numbers.parameters[0, data[0]]))
    group, i = data
    return ca.SX(float(numbers.lanes[group][0, i, lane]))


def _apply(op: str, args: list[Any]) -> Any:
    if op in ("fma", "fnma"):
        return args[2] + args[0] * args[1] if op == "fma" else args[2] - args[0] * args[1]
    if len(args) == 1:
        return ca.SX.unary(_NUMBER[op], args[0])
    return ca.SX.binary(_NUMBER[op], args[0], args[1])
