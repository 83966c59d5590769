"""Graphs from graphs: with some values replaced, and their derivatives, forward and reverse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from .graph import Graph, Value, reachable
from .operations import OPERATIONS, REDUCTIONS
from .program import Numbers, Port, Program

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
    derivatives: dict[Value, Value] = dict(seeds)
    for v in reachable(graph, roots):
        if v in derivatives:
            continue
        node = graph.nodes[v]
        own = [derivatives[a] for a in node.args]
        if all(x == zero for x in own):
            derivatives[v] = zero
        elif node.op in REDUCTIONS:
            assert node.op == "sum", "a minimum over lanes is not differentiated"
            derivatives[v] = graph.reduce("sum", own)
        else:
            total = zero
            for partial, x in zip(
                OPERATIONS[node.op].partials(graph, v, node.args), own, strict=True
            ):
                if partial is not None:
                    total = graph.apply("add", total, graph.apply("mul", partial, x))
            derivatives[v] = total
    return [derivatives[v] for v in roots]


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


def number_ports(numbers: Numbers) -> dict[str, np.ndarray]:
    """Mechanisms' numbers as `numbers_as_ports` takes them, a sample each: (V, size), and of lanes
    (V, size, lanes) in the callers' order."""
    size, n = max((own.shape[1] for own in numbers.lanes), default=0), len(numbers.order)
    lanes, start = np.zeros((len(numbers), size, n)), 0
    for own in numbers.lanes:
        lanes[:, : own.shape[1], list(numbers.order[start : start + own.shape[2]])] = own
        start += own.shape[2]
    return {NUMBERS: numbers.parameters, LANE_NUMBERS: lanes}


def jacobian(
    graph: Graph, roots: Sequence[Value], leaves: Sequence[Value]
) -> list[dict[Value, Value]]:
    """Derivatives of the roots by each of some shared leaves: root -> its derivative.

    What depends on the leaves through a waist alone is differentiated by the waist, whose values
    are fewer than the leaves, and joined to the rest by the chain rule.
    """
    zero, one = graph.const(0.0), graph.const(1.0)
    order = reachable(graph, roots)
    depend = set(leaves)
    for v in order:
        if any(a in depend for a in graph.nodes[v].args):
            depend.add(v)
    beyond: list[tuple[tuple[Value, ...], list[Value], list[list[Value]]]] = []
    for waist in graph.waists:
        if len(waist) < len(leaves) and depend.issuperset(waist):
            ends = _ends(graph, order, depend, waist, roots)
            units = [dict.fromkeys(waist, zero) | {w: one} for w in waist]
            beyond.append((waist, ends, [tangents(graph, ends, unit) for unit in units]))
    rows = []
    for leaf in leaves:
        seeds = dict.fromkeys(leaves, zero) | {leaf: one}
        for waist, ends, slopes in beyond:
            moved = tangents(graph, waist, seeds)
            for i, end in enumerate(ends):
                terms = (graph.apply("mul", s[i], d) for s, d in zip(slopes, moved, strict=True))
                seeds[end] = reduce(lambda a, b: graph.apply("add", a, b), terms)
            seeds |= zip(waist, moved, strict=True)
        rows.append(dict(zip(roots, tangents(graph, roots, seeds), strict=True)))
    return rows


def _ends(
    graph: Graph,
    order: Sequence[Value],
    depend: set[Value],
    waist: Sequence[Value],
    roots: Sequence[Value],
) -> list[Value]:
    """Values that depend on the leaves through a waist alone, and that others use."""
    nodes, beyond = graph.nodes, set(waist)
    for v in order:
        own = [a for a in nodes[v].args if a in depend]
        if own and nodes[v].op not in REDUCTIONS and beyond.issuperset(own):
            beyond.add(v)
    used = {a for v in order if v not in beyond for a in nodes[v].args} | set(roots)
    return [v for v in order if v in beyond and v in used and v not in waist]


def adjoints(
    graph: Graph,
    roots: Sequence[Value],
    cotangents: Sequence[Value],
    of: Sequence[Value],
    counts: Sequence[int],
) -> list[Value]:
    """Derivatives of sum root * cotangent, over roots and lanes, in some values: one reverse sweep.

    A sum hands its adjoint to every lane; what the lanes hand to a shared value is summed. That of
    a lane value is each lane's own.

    Args:    cotangents: one a root, shared as it is or of its lanes.
             of: values, which are taken as independent;  counts: lanes of each group.
    Returns: values of the same graph. A minimum over lanes has no derivative here.
    """
    nodes, zero = graph.nodes, graph.const(0.0)
    handed: dict[Value, list[Value]] = {}

    def hand(v: Value, x: Value) -> None:
        if x != zero:
            handed.setdefault(v, []).append(x)

    def total(v: Value) -> Value:
        """What was handed to a value, over the lanes if it is shared."""
        shared, lanes = zero, [zero] * len(counts)
        for x in handed.get(v, ()):
            group = nodes[x].group
            if nodes[v].group is None and group is not None:
                lanes[group] = graph.apply("add", lanes[group], x)
            else:
                shared = graph.apply("add", shared, x)
        if any(x != zero for x in lanes):
            shared = graph.apply("add", shared, graph.reduce("sum", lanes))
        return shared

    for v, x in zip(roots, cotangents, strict=True):
        hand(v, x)
    order, leaves = reachable(graph, roots), set(of)
    depend = set[Value]()
    for v in order:
        if v in leaves or any(a in depend for a in nodes[v].args):
            depend.add(v)
    for v in reversed(order):
        if v in leaves or v not in depend or (own := total(v)) == zero:
            continue
        node = nodes[v]
        if node.op in REDUCTIONS:
            assert node.op == "sum", "a minimum over lanes is not differentiated"
            for a, count in zip(node.args, counts, strict=True):
                shared = nodes[a].group is None
                hand(a, graph.apply("mul", graph.const(float(count)), own) if shared else own)
            continue
        for a, partial in zip(
            node.args, OPERATIONS[node.op].partials(graph, v, node.args), strict=True
        ):
            # A lane value may hand to a shared one what is the same in all its lanes.
            if partial is not None and a in depend:
                x = graph.apply("mul", partial, own)
                if node.group is not None and nodes[a].group is None and nodes[x].group is None:
                    x = graph.apply("mul", graph.const(float(counts[node.group])), x)
                hand(a, x)
    return [total(v) for v in of]
