"""Graphs from graphs: with some values replaced, and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from .graph import Graph, Value, reachable
from .operations import OPERATIONS, REDUCTIONS
from .program import Port, Program

NUMBERS, LANE_NUMBERS = "numbers", "lane_numbers"  # ports of what else is fixed


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


def numbers_as_ports(program: Program, shared: int, lanes: Sequence[int]) -> Program:
    """A program that takes a mechanism's numbers with every sample, by two more ports: `numbers`,
    the shared ones, and `lane_numbers`, of every lane as many as the group with most has.

    Args: shared: how many parameters there are;  lanes: numbers of a lane, group by group.
    """
    graph, counts, first = program.graph, program.counts, program.columns
    n, size = sum(counts), max(lanes, default=0)
    starts = [sum(counts[:group]) for group in range(len(counts))]
    replaced: dict[Value, Value] = {}
    for v in program.order:
        node = graph.nodes[v]
        if node.op == "parameter":
            (i,) = node.data
            assert isinstance(i, int)
            replaced[v] = graph.leaf("input", first + i)
        elif node.op == "lane":
            group, i = node.data
            assert isinstance(group, int) and isinstance(i, int)
            column = first + shared + i * n + starts[group]
            replaced[v] = graph.leaf("lane_input", group, column, group=group)
    moved = substituted(graph, program.roots, replaced)
    ports = [Port(NUMBERS, shared, "", False, first)] if shared else []
    ports += [Port(LANE_NUMBERS, size, "", True, first + shared)] if size else []
    found = program.moved(graph, dict(zip(program.roots, moved, strict=True)))
    columns = first + shared + size * n
    return replace(found, columns=columns, ports=(*program.ports, *ports))
