"""Expressions as a graph of scalar operations, ready to print as code.

CasADi's instruction list becomes hash-consed nodes. Two properties decide how a node is printed:

- `group`: None for values that all chains share, else the chain family whose lanes it varies over;
- `varies`: whether it changes from sample to sample; the rest is computed once a mechanism.

Reductions (`sum`, `least`) take lane values to shared ones. Arc functions whose angle is only
wanted for its sine and cosine disappear on the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca

from ..errors import UnsupportedError

Value = int  # a node's number

_BINARY = {
    ca.OP_ADD: "add",
    ca.OP_SUB: "sub",
    ca.OP_MUL: "mul",
    ca.OP_DIV: "div",
    ca.OP_ATAN2: "atan2",
    ca.OP_FMIN: "fmin",
    ca.OP_FMAX: "fmax",
    ca.OP_LE: "le",  # 1 or 0
    ca.OP_LT: "lt",
    ca.OP_EQ: "eq",
    ca.OP_NE: "ne",
    ca.OP_AND: "and",
    ca.OP_OR: "or",
    ca.OP_IF_ELSE_ZERO: "where",
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
    ca.OP_FMOD: "fmod",
    ca.OP_REMAINDER: "remainder",
    ca.OP_COPYSIGN: "copysign",
    ca.OP_HYPOT: "hypot",
}
_UNARY = {
    ca.OP_NEG: "neg",
    ca.OP_SQRT: "sqrt",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_FABS: "fabs",
    ca.OP_NOT: "not",
    ca.OP_SIGN: "sign",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
    ca.OP_EXP: "exp",
    ca.OP_EXPM1: "expm1",
    ca.OP_LOG: "log",
    ca.OP_LOG1P: "log1p",
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh",
    ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh",
    ca.OP_ATANH: "atanh",
    ca.OP_ERF: "erf",
}
REDUCTIONS = ("sum", "least")


@dataclass(frozen=True)
class Node:
    """One operation. args: nodes; data: what a leaf is (a number, or where it is stored)."""

    op: str
    args: tuple[Value, ...]
    data: tuple[object, ...]
    group: int | None
    varies: bool
    phase: int


@dataclass
class Graph:
    """Nodes in an order in which arguments come first."""

    nodes: list[Node] = field(default_factory=list)
    _known: dict[tuple[object, ...], Value] = field(default_factory=dict)

    def leaf(self, op: str, *data: object, group: int | None = None) -> Value:
        """A stored value: ("input", i), ("parameter", i), ("lane", g, i) or ("const", x)."""
        return self._node(op, (), data, group, op == "input", 0)

    def const(self, value: float) -> Value:
        return self.leaf("const", float(value))

    def reduce(self, op: str, terms: Sequence[Value]) -> Value:
        """Sum or minimum over the lanes of every group, one term a group."""
        assert op in REDUCTIONS
        varies = any(self.nodes[t].varies for t in terms)
        phase = max(self.nodes[t].phase for t in terms) + 1
        return self._node(op, tuple(terms), (), None, varies, phase)

    def apply(self, op: str, *args: Value) -> Value:
        """An arithmetic operation, simplified where that costs nothing in accuracy."""
        simple = self._simplified(op, args)
        if simple is not None:
            return simple
        if op in ("add", "mul", "fmin", "fmax"):
            args = tuple(sorted(args))
        nodes = [self.nodes[a] for a in args]
        groups = {n.group for n in nodes} - {None}
        assert len(groups) <= 1, "an expression mixes the lanes of two families"
        return self._node(
            op,
            args,
            (),
            next(iter(groups), None),
            any(n.varies for n in nodes),
            max(n.phase for n in nodes),
        )

    def copy(self, node: Node, args: tuple[Value, ...]) -> Value:
        """The same operation on other arguments."""
        return self._node(node.op, args, node.data, node.group, node.varies, node.phase)

    def _node(
        self,
        op: str,
        args: tuple[Value, ...],
        data: tuple[object, ...],
        group: int | None,
        varies: bool,
        phase: int,
    ) -> Value:
        key = (op, args, data)
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append(Node(op, args, data, group, varies, phase))
        return self._known[key]

    def _simplified(self, op: str, args: tuple[Value, ...]) -> Value | None:
        a = args[0]
        A = self.nodes[a]
        if op == "neg":
            if A.op == "neg":
                return A.args[0]
            if A.op == "const":
                return self.const(-A.data[0])  # type: ignore[operator]
            if A.op == "sub":
                return self.apply("sub", A.args[1], A.args[0])
            return None
        if op in ("sin", "cos"):
            return self._of_arc(op, A)
        if len(args) < 2:
            return None
        b = args[1]
        B = self.nodes[b]
        number = {x: n.data[0] for x, n in ((a, A), (b, B)) if n.op == "const"}
        if len(number) == len({a, b}):
            x, y = number[a], number[b]
            folded = {"add": x + y, "sub": x - y, "mul": x * y}.get(op)  # type: ignore[operator]
            return None if folded is None else self.const(folded)
        if op == "add":
            if 0.0 in (number.get(a), number.get(b)):
                return b if number.get(a) == 0.0 else a
            if B.op == "neg":
                return self.apply("sub", a, B.args[0])
            if A.op == "neg":
                return self.apply("sub", b, A.args[0])
        if op == "sub":
            if number.get(b) == 0.0:
                return a
            if number.get(a) == 0.0:
                return self.apply("neg", b)
            if B.op == "neg":
                return self.apply("add", a, B.args[0])
            if A.op == "neg":
                return self.apply("neg", self.apply("add", A.args[0], b))
        if op == "div":
            if a == b:
                return self.const(1.0)
            if number.get(a) != 1.0:
                # One reciprocal serves every division by b.
                return self.apply("mul", a, self.apply("div", self.const(1.0), b))
            if B.op == "div" and B.args[0] == a:
                return B.args[1]
            if B.op == "neg":
                return self.apply("neg", self.apply("div", a, B.args[0]))
        if op == "mul":
            if number.get(b) == 1.0:
                return a
            if number.get(b) == -1.0:
                return self.apply("neg", a)
            if number.get(a) in (1.0, -1.0):
                return b if number[a] == 1.0 else self.apply("neg", b)
            if 0.0 in (number.get(a), number.get(b)):
                return self.const(0.0)
            if A.op == "neg" and B.op == "neg":
                return self.apply(op, A.args[0], B.args[0])
            if A.op == "neg":
                return self.apply("neg", self.apply(op, A.args[0], b))
            if B.op == "neg":
                return self.apply("neg", self.apply(op, a, B.args[0]))
        return None

    def _of_arc(self, op: str, arc: Node) -> Value | None:
        """Sine or cosine of an atan2, without it."""
        if arc.op != "atan2":
            return None
        y, x = arc.args
        square = self.apply("add", self.apply("mul", x, x), self.apply("mul", y, y))
        return self.apply("div", y if op == "sin" else x, self.apply("sqrt", square))


def read(
    graph: Graph, outputs: Sequence[ca.SX], known: dict[str, Value], free: Sequence[ca.SX]
) -> list[list[Value]]:
    """Nodes of expressions, entry by entry.

    Args: known: symbol name -> node, for every symbol in `free`, the symbols that occur.
    """
    symbols = ca.vertcat(*free)
    function = ca.Function("expressions", [symbols], [ca.densify(o) for o in outputs])
    names = [free_symbol.name() for free_symbol in free]
    work: dict[int, Value] = {}
    found: list[list[Value]] = [[-1] * o.numel() for o in outputs]
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        ins, outs = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_CONST:
            work[outs[0]] = graph.const(function.instruction_constant(k))
        elif op == ca.OP_INPUT:
            work[outs[0]] = known[names[ins[1]]]
        elif op == ca.OP_OUTPUT:
            found[outs[0]][outs[1]] = work[ins[0]]
        else:
            work[outs[0]] = _operation(graph, op, [work[i] for i in ins])
    return found


def _operation(graph: Graph, op: int, args: list[Value]) -> Value:
    if op in (ca.OP_CONSTPOW, ca.OP_POW):
        exponent = graph.nodes[args[1]]
        if exponent.op == "const" and exponent.data[0] in (2.0, 3.0, 4.0):
            square = graph.apply("mul", args[0], args[0])
            if exponent.data[0] == 2.0:
                return square
            return graph.apply("mul", square, args[0] if exponent.data[0] == 3.0 else square)
    if op in _BINARY:
        return graph.apply(_BINARY[op], args[0], args[1])
    if op in _UNARY:
        return graph.apply(_UNARY[op], args[0])
    if op == ca.OP_SQ:
        return graph.apply("mul", args[0], args[0])
    if op == ca.OP_TWICE:
        return graph.apply("add", args[0], args[0])
    if op == ca.OP_INV:
        return graph.apply("div", graph.const(1.0), args[0])
    if op == ca.OP_ASSIGN:
        return args[0]
    raise UnsupportedError(f"CasADi's operation number {op} has no C in kernels")


def reachable(graph: Graph, roots: Sequence[Value]) -> list[Value]:
    """Nodes that the roots need, arguments first, depth first."""
    order: list[Value] = []
    seen: set[Value] = set()
    for root in roots:
        stack: list[tuple[Value, bool]] = [(root, False)]
        while stack:
            value, ready = stack.pop()
            if ready:
                order.append(value)
            elif value not in seen:
                seen.add(value)
                stack.append((value, True))
                stack.extend((a, False) for a in reversed(graph.nodes[value].args))
    return order
