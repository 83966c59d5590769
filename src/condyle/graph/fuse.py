"""Sums of products as chains of fused multiply-adds.

A tree of additions whose inner values are used only there is one sum of terms; a term that is a
product used only there joins it by a fused multiply-add. Terms join in the order in which they
become ready.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from . import operations
from .graph import Graph, Node, Value, reachable


def latency(node: Node) -> int:
    """Cycles from a node's arguments to its value."""
    return operations.latency(node.op) if node.args else 0


Note = Callable[[Value], Value]  # remembers when a new value is ready


@dataclass(frozen=True)
class SignedProduct:
    sign: int
    factors: tuple[Value, ...]  # of the new graph: one value, or two to multiply
    ready: int


def fuse(graph: Graph, roots: Sequence[Value], chain: int) -> tuple[Graph, list[Value]]:
    """The same values with products joined to sums.

    Args: chain: terms above which a sum becomes two that run side by side.
    """
    order = reachable(graph, roots)
    uses: dict[Value, int] = dict.fromkeys(order, 0)
    for v in order:
        for a in graph.nodes[v].args:
            uses[a] += 1
    for v in roots:
        uses[v] += 1
    inside = _inside(graph, order, uses)
    new, moved = Graph(), dict[Value, Value]()
    ready = dict[Value, int]()

    def note(value: Value) -> Value:
        if value not in ready:
            node = new.nodes[value]
            start = max((ready[note(a)] for a in node.args), default=0)
            ready[value] = start + latency(node)
        return value

    def terms(v: Value, sign: int) -> list[SignedProduct]:
        node = graph.nodes[v]
        if node.op in ("add", "sub", "neg") and (v in inside or v == top):
            signs = {"add": (1, 1), "sub": (1, -1), "neg": (-1,)}[node.op]
            return [t for a, s in zip(node.args, signs, strict=True) for t in terms(a, s * sign)]
        if node.op == "mul" and v in inside:
            *early, late = sorted(factors(v), key=lambda x: ready[x])
            pair = (_product(new, early, ready, note), late)
            return [SignedProduct(sign, pair, max(ready[x] for x in pair))]
        return [SignedProduct(sign, (moved[v],), ready[moved[v]])]

    def factors(v: Value) -> list[Value]:
        node = graph.nodes[v]
        parts = []
        for a in node.args:
            parts += factors(a) if graph.nodes[a].op == "mul" and a in inside else [moved[a]]
        return parts

    for v in order:
        node = graph.nodes[v]
        if v in inside:
            continue
        if node.op == "mul":
            moved[v] = _product(new, factors(v), ready, note)
        elif node.op in ("add", "sub"):
            top = v
            parts = sorted(terms(v, 1), key=lambda t: (len(t.factors) > 1, t.ready))
            moved[v] = _sum(new, parts, chain, note)
        else:
            args = tuple(moved[a] for a in node.args)
            if node.op == "sum" and all(new.nodes[a].op == "neg" for a in args):
                # One sign after the sum instead of one a lane.
                total = new.copy(node, tuple(new.nodes[a].args[0] for a in args))
                moved[v] = note(new.apply("neg", note(total)))
            else:
                moved[v] = note(new.copy(node, args))
    return new, [moved[v] for v in roots]


def _inside(graph: Graph, order: Sequence[Value], uses: dict[Value, int]) -> set[Value]:
    """Values used only by one sum or product, which absorbs them."""
    inside = set()
    for v in order:
        node = graph.nodes[v]
        if node.op not in ("add", "sub", "mul"):
            continue
        wanted = ("mul",) if node.op == "mul" else ("add", "sub", "mul")
        for a in node.args:
            inner = graph.nodes[a]
            same = all(getattr(inner, x) == getattr(node, x) for x in ("group", "varies", "phase"))
            if uses[a] == 1 and same and inner.op in wanted:
                inside.add(a)
    return inside


def _product(new: Graph, factors: list[Value], ready: dict[Value, int], note: Note) -> Value:
    """Factors that are ready first are multiplied first."""
    rest = sorted(factors, key=lambda x: ready[x])
    while len(rest) > 1:
        product = note(new.apply("mul", rest[0], rest[1]))
        rest = sorted([product, *rest[2:]], key=lambda x: ready[x])
    return rest[0]


def _sum(new: Graph, terms: list[SignedProduct], chain: int, note: Note) -> Value:
    if len(terms) > chain:
        products = [t for t in terms if len(t.factors) > 1]
        plain = [t for t in terms if len(t.factors) == 1]
        left, right = plain[::2] + products[::2], plain[1::2] + products[1::2]
        if left and right:
            a, b = _sum(new, left, chain, note), _sum(new, right, chain, note)
            return note(new.apply("add", a, b))
    total: Value | None = None
    # A positive plain term first, so that no sign has to be changed.
    terms = sorted(terms, key=lambda t: t.sign < 0 and len(t.factors) == 1)
    start = next((i for i, t in enumerate(terms) if t.sign > 0), 0)
    terms = [terms[start], *terms[:start], *terms[start + 1 :]]
    for t in terms:
        if len(t.factors) == 1:
            if total is None:
                total = t.factors[0] if t.sign > 0 else note(new.apply("neg", t.factors[0]))
            else:
                total = note(new.apply("add" if t.sign > 0 else "sub", total, t.factors[0]))
        elif total is None:
            total = note(new.apply("mul", *t.factors))
            if t.sign < 0:
                total = note(new.apply("neg", total))
        else:
            total = note(new.apply("fma" if t.sign > 0 else "fnma", *t.factors, total))
    assert total is not None
    return total
