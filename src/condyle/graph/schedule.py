"""List scheduling of a single evaluation's statements.

Statements are issued two per cycle: of those whose arguments are ready, the one with the longest
remaining path first. Compilers mostly keep that order. (A batch gains nothing: there the
neighbouring chain fills the gaps, and long live ranges cost memory traffic.)
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

from .fuse import latency
from .graph import Graph, Value

ISSUE = 2  # arithmetic statements a cycle


def scheduled(
    graph: Graph, values: Sequence[Value], bundles: Sequence[Sequence[Value]] = ()
) -> list[Value]:
    """The values in an order that shortens one evaluation; arguments stay first.

    Args: bundles: values that are computed together; the first represents the others, which are
          omitted.
    """
    stands = {v: bundle[0] for bundle in bundles for v in bundle}
    args = {v: {stands.get(a, a) for a in graph.nodes[v].args} for v in values}
    for v, first in stands.items():
        args[first] |= args[v]
    values = _sorted([v for v in values if stands.get(v, v) == v], args)
    position = {v: i for i, v in enumerate(values)}
    users: dict[Value, list[Value]] = {v: [] for v in values}
    waiting: dict[Value, int] = {}
    for v in values:
        inside = {a for a in args[v] if a in position}
        waiting[v] = len(inside)
        for a in inside:
            users[a].append(v)
    way: dict[Value, int] = {}
    for v in reversed(values):
        way[v] = latency(graph.nodes[v]) + max((way[u] for u in users[v]), default=0)

    order: list[Value] = []
    future: list[tuple[int, int, Value]] = []  # ready at a later cycle
    ready: list[tuple[int, int, Value]] = []  # (-way, position, value)
    done: dict[Value, int] = {}
    for v in values:
        if not waiting[v]:
            heapq.heappush(ready, (-way[v], position[v], v))
    cycle = 0
    while ready or future:
        while future and future[0][0] <= cycle:
            _, _, v = heapq.heappop(future)
            heapq.heappush(ready, (-way[v], position[v], v))
        for _ in range(min(ISSUE, len(ready))):
            _, _, v = heapq.heappop(ready)
            order.append(v)
            done[v] = cycle + latency(graph.nodes[v])
            for u in users[v]:
                waiting[u] -= 1
                if not waiting[u]:
                    at = max(done[a] for a in args[u] if a in done)
                    heapq.heappush(future, (at, position[u], u))
        cycle += 1
    return order


def _sorted(values: list[Value], args: dict[Value, set[Value]]) -> list[Value]:
    """Arguments first, otherwise in the given order."""
    order: list[Value] = []
    seen = set[Value]()
    inside = set(values)
    for root in values:
        stack = [root]
        while stack:
            v = stack[-1]
            missing = [a for a in args[v] if a in inside and a not in seen]
            if missing:
                stack += missing
                continue
            stack.pop()
            if v not in seen:
                seen.add(v)
                order.append(v)
    return order


def ready_times(graph: Graph, values: Sequence[Value]) -> dict[Value, int]:
    """Earliest cycle in which each value is ready."""
    ready: dict[Value, int] = {}
    for v in values:
        node = graph.nodes[v]
        start = max((ready.get(a, 0) for a in node.args), default=0)
        ready[v] = start + latency(node)
    return ready
