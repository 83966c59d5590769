"""Expressions as a graph of hash-consed scalar operations, ready to run.

Two properties decide how a node is computed:

- `group`: None for values that all lanes share, else the group of lanes that it varies over;
- `varies`: whether it changes from sample to sample; the rest is computed once a mechanism.

Reductions (`sum`, `least`) take lane values to shared ones. Arc functions whose angle is used only
for its sine and cosine are eliminated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from .operations import REDUCTIONS, Value

VARYING = ("input", "lane_input")  # leaves that change from sample to sample


@dataclass(frozen=True)
class Node:
    """One operation. args: nodes; data: of a leaf, its number or place of storage."""

    op: str
    args: tuple[Value, ...]
    data: tuple[object, ...]
    group: int | None
    varies: bool
    phase: int


@dataclass
class Graph:
    """Nodes in an order in which arguments come first.

    waists: sets of few values through which many others depend on the inputs, for derivatives.
    """

    nodes: list[Node] = field(default_factory=list)
    waists: list[tuple[Value, ...]] = field(default_factory=list)
    _known: dict[tuple[object, ...], Value] = field(default_factory=dict)

    def leaf(self, op: str, *data: object, group: int | None = None) -> Value:
        """A stored value.

        ("input", i) of a sample, ("lane_input", g, i) of a sample and lane, ("parameter", i),
        ("lane", g, i), or ("const", x).
        """
        return self._node(op, (), data, group, op in VARYING, 0)

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


def reachable(graph: Graph, roots: Sequence[Value]) -> list[Value]:
    """Nodes that the roots depend on, arguments first, depth first."""
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


__all__ = ["VARYING", "Graph", "Node", "Value", "reachable"]
