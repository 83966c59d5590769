"""Exact directional derivatives of another question, by tangents of its graph.

With unit directions as samples, all derivatives are one batch.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

from ..graph.graph import Value
from ..graph.program import Program, Variants
from ..graph.transform import tangents

PREFIX = "d_"  # of a port's direction, and of a result's derivative along it


def derivative(found: Program | Variants, by: Collection[str], of: Collection[str]) -> Program:
    """A question with additional ports `d_<port>` and results `d_<result>`, without checks.

    Args: by: ports;  of: results.
    """
    program = found.robust or found.main if isinstance(found, Variants) else found
    graph, columns, ports = program.graph, program.columns, list(program.ports)
    seeds: dict[Value, Value] = {}
    lanes = sum(program.counts)
    for port in program.ports:
        if port.name not in by:
            continue
        ports.append(replace(port, name=PREFIX + port.name, start=columns))
        for i in range(port.size):
            if not port.lanes:
                seeds[graph.leaf("input", port.start + i)] = graph.leaf("input", columns + i)
                continue
            before = i * lanes
            for group, count in enumerate(program.counts):
                here, along = (
                    graph.leaf("lane_input", group, start + before, group=group)
                    for start in (port.start, columns)
                )
                seeds[here] = along
                before += count
        columns += port.size * (lanes if port.lanes else 1)
    chosen = [o for o in program.outputs if o.name in of]
    roots = [v for o in chosen for entry in o.entries for v in entry if v is not None]
    moved: Mapping[Value | None, Value | None] = {
        None: None, **dict(zip(roots, tangents(graph, roots, seeds), strict=True))
    }  # fmt: skip
    outputs = tuple(
        replace(
            o, name=PREFIX + o.name, entries=tuple(tuple(moved[v] for v in e) for e in o.entries)
        )
        for o in chosen
    )
    return Program(graph, program.counts, columns, tuple(ports), outputs, ())
