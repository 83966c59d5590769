"""Exact derivatives of another question, by its graph.

Forward, along directions of ports and numbers; in unit directions of ports, whose intermediate
values share all that does not depend on the direction; and reverse, from weights of results.
Numbers are those of the kernel: `numbers` and `lane_numbers` stand among the ports for all of
them, as if these were ports.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

from ..graph.graph import Value, reachable
from ..graph.program import Output, Port, Program, Programs
from ..graph.transform import LANE_NUMBERS, NUMBERS, adjoints, jacobian, tangents
from .numbers import Layout
from .structure import Structure

PREFIX = "d_"  # of a port's direction, and of a result's derivative along it
WEIGHT, GRADIENT = "w_", "g_"  # of a result's weight, and of the derivative in a port
OF_NUMBERS = (NUMBERS, LANE_NUMBERS)  # names of the kernel's numbers among ports
Entries = list[tuple[Value | None, ...]]  # of a port, as those of an `Output`


def derivative(
    structure: Structure,
    how: str,
    question: str,
    details: tuple[object, ...],
    by: tuple[str, ...],
    of: tuple[str, ...],
) -> Programs:
    """A question's derivatives of results `of` by ports and numbers `by`, with its checks.

    Args: how: directional, slopes or gradient: the functions of this file.
    """
    from . import written

    programs = written(question)(structure, *details)
    take, layout = HOW[how], Layout.of(structure)
    if isinstance(programs, Program):
        return Programs(take(programs, by, of, layout))
    robust = programs.write_robust
    return Programs(
        take(programs.main, by, of, layout), robust and (lambda: take(robust(), by, of, layout))
    )


def directional(
    program: Program, by: Collection[str], of: Collection[str], layout: Layout | None = None
) -> Program:
    """A question with additional ports `d_<port>` and results `d_<result>`."""
    program, roots = _of(program, of)
    graph, columns, ports = program.graph, program.columns, list(program.ports)
    seeds: dict[Value, Value] = {}
    for name, lanes, entries in _places(program, by, layout):
        ports.append(Port(PREFIX + name, len(entries), "", lanes, columns))
        direction = _entries(program, ports[-1])
        for here, towards in zip(entries, direction, strict=True):
            pairs = zip(here, towards, strict=True)
            seeds |= {v: d for v, d in pairs if v is not None and d is not None}
        columns += _width(program, ports[-1])
    where = dict(zip(roots, tangents(graph, roots, seeds), strict=True))
    outputs = tuple(
        replace(
            o,
            name=PREFIX + o.name,
            entries=tuple(_moved(e, where) for e in o.entries),
        )
        for o in program.outputs
    )
    return replace(program, columns=columns, ports=tuple(ports), outputs=outputs)


def slopes(program: Program, by: Collection[str], of: Collection[str], layout: Layout) -> Program:
    """Results `<result>/<port>`, with the entries of the port as a last dimension.

    Ports of lanes are asked for shared results alone, and give lanes.
    """
    program, roots = _of(program, of)
    graph, unit, outputs = program.graph, program.graph.const(1.0), list[Output]()
    asked = _places(program, by, layout)
    shared = [v for _, lanes, entries in asked if not lanes for (v,) in entries if v is not None]
    to = dict(zip(shared, jacobian(graph, roots, shared), strict=True))
    for name, lanes, entries in asked:
        for o in program.outputs:
            assert not (o.lanes and lanes), "lanes by lanes"
            if lanes:
                leaves = [v for e in entries for v in e if v is not None]
                adjoint_rows = [
                    adjoints(graph, [v], [unit], leaves, program.counts)
                    for (v,) in o.entries
                    if v is not None
                ]
                rows = [dict(zip(leaves, row, strict=True)) for row in adjoint_rows]
                own = [_moved(e, row) for row in rows for e in entries]
            else:
                own = [_moved(e, to[v]) for e in o.entries for (v,) in entries if v is not None]
            shape = (*o.shape, len(entries))
            outputs.append(Output(f"{o.name}/{name}", shape, "", lanes or o.lanes, tuple(own)))
    return replace(program, outputs=tuple(outputs))


def gradient(program: Program, by: Collection[str], of: Collection[str], layout: Layout) -> Program:
    """Results `g_<port>`: the derivatives of sum w . result, with ports `w_<result>`.

    Of numbers there is one result each, `g_numbers/<i>`, of those that matter.
    """
    program, _ = _of(program, of)
    columns, ports = program.columns, list(program.ports)
    roots: list[Value] = []
    weights: list[Value] = []
    for o in program.outputs:
        ports.append(Port(WEIGHT + o.name, len(o.entries), "", o.lanes, columns))
        for entry, weight in zip(o.entries, _entries(program, ports[-1]), strict=True):
            pairs = [(v, w) for v, w in zip(entry, weight, strict=True) if v is not None]
            roots += [v for v, _ in pairs]
            weights += [w for _, w in pairs if w is not None]
        columns += _width(program, ports[-1])
    used = set(reachable(program.graph, roots))
    inputs: list[tuple[str, bool, Entries]] = []
    for name, lanes, entries in _places(program, by, layout):
        if name not in OF_NUMBERS:
            inputs.append((name, lanes, entries))
            continue
        for i, entry in enumerate(entries):
            if own := used.intersection(entry):
                one = tuple(v if v in own else None for v in entry)
                inputs.append((f"{name}/{i}", lanes, [one]))
    leaves = [v for *_, entries in inputs for e in entries for v in e if v is not None]
    moved = adjoints(program.graph, roots, weights, leaves, program.counts)
    to = dict(zip(leaves, moved, strict=True))
    outputs = (
        Output(GRADIENT + name, (len(entries),), "", lanes, tuple(_moved(e, to) for e in entries))
        for name, lanes, entries in inputs
    )
    return replace(program, columns=columns, ports=tuple(ports), outputs=tuple(outputs))


HOW = {"directional": directional, "slopes": slopes, "gradient": gradient}


def _of(program: Program, of: Collection[str]) -> tuple[Program, list[Value]]:
    """A program with some of its results alone, and their values."""
    outputs = tuple(o for o in program.outputs if o.name in of)
    found = (v for o in outputs for entry in o.entries for v in entry if v is not None)
    return replace(program, outputs=outputs), list(dict.fromkeys(found))


def _places(
    program: Program, by: Collection[str], layout: Layout | None
) -> list[tuple[str, bool, Entries]]:
    """Ports and numbers: name, whether they are of lanes, entries."""
    places = [(p.name, p.lanes, _entries(program, p)) for p in program.ports if p.name in by]
    graph = program.graph
    if layout is not None:
        shared, lanes = layout.sizes
        if NUMBERS in by:
            places.append((NUMBERS, False, [(graph.leaf("parameter", i),) for i in range(shared)]))
        if LANE_NUMBERS in by:
            rows: Entries = [
                tuple(
                    graph.leaf("lane", g, i, group=g) if i < size else None
                    for g, size in enumerate(lanes)
                )
                for i in range(max(lanes))
            ]
            places.append((LANE_NUMBERS, True, rows))
    return places


def _entries(program: Program, port: Port) -> Entries:
    graph = program.graph
    if not port.lanes:
        return [(graph.leaf("input", port.start + i),) for i in range(port.size)]
    entries: Entries = []
    for i in range(port.size):
        start, row = port.start + i * sum(program.counts), []
        for group, count in enumerate(program.counts):
            row.append(graph.leaf("lane_input", group, start, group=group))
            start += count
        entries.append(tuple(row))
    return entries


def _moved(
    entry: tuple[Value | None, ...], where: Mapping[Value, Value]
) -> tuple[Value | None, ...]:
    return tuple(v if v is None else where[v] for v in entry)


def _width(program: Program, port: Port) -> int:
    return port.size * (sum(program.counts) if port.lanes else 1)
