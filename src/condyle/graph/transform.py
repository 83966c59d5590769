"""Graphs from graphs: with some values replaced, and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .graph import Graph, Value, reachable
from .operations import OPERATIONS, REDUCTIONS


def substituted(
    graph: Graph, roots: Sequence[Value], replace: Mapping[Value, Value]
) -> list[Value]:
    """The roots, in the same graph, with some values in the place of others."""
    moved = dict(replace)
    for v in reachable(graph, roots):
        if v in moved:
            continue
        node = graph.nodes[v]
        args = tuple(moved[a] for a in node.args)
        if args == node.args:
            moved[v] = v
        elif node.op in REDUCTIONS:
            moved[v] = graph.reduce(node.op, args)
        else:
            moved[v] = graph.apply(node.op, *args)
    return [moved[v] for v in roots]


def tangents(graph: Graph, roots: Sequence[Value], seeds: Mapping[Value, Value]) -> list[Value]:
    """Derivatives of the roots along one direction, also across sums over lanes.

    Args:    seeds: value -> its derivative; these are taken as independent.
    Returns: values of the same graph. A minimum over lanes has no derivative here.
    """
    zero = graph.const(0.0)
    found: dict[Value, Value] = dict(seeds)
    for v in reachable(graph, roots):
        if v in found:
            continue
        node = graph.nodes[v]
        own = [found[a] for a in node.args]
        if all(x == zero for x in own):
            found[v] = zero
        elif node.op in REDUCTIONS:
            assert node.op == "sum", "a minimum over lanes is not differentiated"
            found[v] = graph.reduce("sum", own)
        else:
            total = zero
            for partial, x in zip(
                OPERATIONS[node.op].partials(graph, v, node.args), own, strict=True
            ):
                if partial is not None:
                    total = graph.apply("add", total, graph.apply("mul", partial, x))
            found[v] = total
    return [found[v] for v in roots]
