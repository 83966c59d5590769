"""A question's graph with its ports: inputs, outputs and checks."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from .graph import Graph, Value, reachable


@dataclass(frozen=True)
class Port:
    """An input of every sample: `size` numbers, or `size` per lane.

    start: its first column; lanes of a group stand side by side.
    """

    name: str
    size: int
    unit: str
    lanes: bool
    start: int


@dataclass(frozen=True)
class Output:
    """A result of a shape; `lanes`: one of that shape for each lane.

    entries: row by row, one value for a shared result, one a group for lanes: None where a group
             has no such result.
    """

    name: str
    shape: tuple[int, ...]
    unit: str
    lanes: bool
    entries: tuple[tuple[Value | None, ...], ...]

    def groups(self) -> tuple[int, ...]:
        """Groups of lanes that have the result."""
        some = self.entries[0] if self.entries else ()
        return tuple(g for g, v in enumerate(some) if v is not None) if self.lanes else ()


@dataclass(frozen=True)
class OutputShape:
    """The interface of an output; `groups`: of lanes that have it."""

    name: str
    shape: tuple[int, ...]
    unit: str
    lanes: bool
    groups: tuple[int, ...]


@dataclass(frozen=True)
class Interface:
    """The interface of a program: enough to run it once it is compiled.

    counts: lanes of each group;  columns: inputs of a sample.
    """

    counts: tuple[int, ...]
    columns: int
    ports: tuple[Port, ...]
    results: tuple[OutputShape, ...]

    @property
    def lanes(self) -> int:
        return sum(self.counts)

    def width(self, result: OutputShape) -> int:
        """Columns of a result."""
        lanes = sum(self.counts[g] for g in result.groups) if result.lanes else 1
        return math.prod(result.shape) * lanes

    def data(self) -> dict[str, Any]:
        """As JSON takes it."""
        return json.loads(json.dumps(asdict(self)))

    @staticmethod
    def of(data: Mapping[str, Any]) -> Interface:
        """The inverse of `data`."""
        ports = tuple(Port(**port) for port in data["ports"])
        results = tuple(
            OutputShape(**{**r, "shape": tuple(r["shape"]), "groups": tuple(r["groups"])})
            for r in data["results"]
        )
        return Interface(tuple(data["counts"]), data["columns"], ports, results)


@dataclass(frozen=True)
class Check:
    """A condition on a sample.

    Negative values give the status `below`; NaN, values under the tolerance, and negative ones
    where `below` is None, mark the sample to be repeated by a more robust method.
    """

    value: Value
    tolerance: float
    below: int | None


@dataclass(frozen=True)
class Program:
    """A frozen question.

    counts:  lanes of each group;  columns: inputs of a sample.
    """

    graph: Graph
    counts: tuple[int, ...]
    columns: int
    ports: tuple[Port, ...]
    outputs: tuple[Output, ...]
    checks: tuple[Check, ...]

    @cached_property
    def interface(self) -> Interface:
        results = (OutputShape(o.name, o.shape, o.unit, o.lanes, o.groups()) for o in self.outputs)
        return Interface(self.counts, self.columns, self.ports, tuple(results))

    @cached_property
    def roots(self) -> tuple[Value, ...]:
        """Values of all outputs and checks."""
        found = [v for o in self.outputs for entry in o.entries for v in entry if v is not None]
        return tuple(dict.fromkeys([*found, *(c.value for c in self.checks)]))

    def stored(self) -> Iterator[tuple[int, Value, int]]:
        """First column, value and lanes of every result, then of every check."""
        at = 0
        for o in self.outputs:
            for entry in o.entries:
                for group, v in enumerate(entry):
                    if v is not None:
                        lanes = self.counts[group] if o.lanes else 1
                        yield at, v, lanes
                        at += lanes
        yield from ((at + i, check.value, 1) for i, check in enumerate(self.checks))

    @cached_property
    def order(self) -> tuple[Value, ...]:
        """Values that the roots depend on, arguments first."""
        return tuple(reachable(self.graph, self.roots))

    def moved(self, graph: Graph, where: dict[Value | None, Value]) -> Program:
        """The same with values of another graph."""
        outputs = tuple(
            replace(
                o, entries=tuple(tuple(v if v is None else where[v] for v in e) for e in o.entries)
            )
            for o in self.outputs
        )
        checks = tuple(replace(c, value=where[c.value]) for c in self.checks)
        return replace(self, graph=graph, outputs=outputs, checks=checks)

    @cached_property
    def digest(self) -> str:
        """A hash of the computation."""
        number = {v: i for i, v in enumerate(self.order)}
        h = hashlib.sha256(repr((self.counts, self.columns)).encode())
        for v in self.order:
            n = self.graph.nodes[v]
            h.update(repr((n.op, [number[a] for a in n.args], n.data, n.group)).encode())
        for o in self.outputs:
            entries = [[None if v is None else number[v] for v in e] for e in o.entries]
            h.update(repr((o.name, o.shape, o.lanes, entries)).encode())
        for c in self.checks:
            h.update(repr((number[c.value], c.tolerance, c.below)).encode())
        return h.hexdigest()


@dataclass(frozen=True)
class Programs:
    """The programs of a question, with equal ports, outputs and checks.

    main:    fast; samples that fail its checks are repeated by `robust`, if there is one.
    latency: the same as main with a shorter critical path, for single evaluations.
    single:  whether single evaluations are compiled as well as batches.

    The others are written when they are first wanted: numpy seldom needs one, never the other.
    """

    main: Program
    write_robust: Callable[[], Program] | None = None
    write_latency: Callable[[], Program] | None = None
    single: bool = False

    @cached_property
    def robust(self) -> Program | None:
        return self._written(self.write_robust)

    @cached_property
    def latency(self) -> Program | None:
        return self._written(self.write_latency)

    def _written(self, write: Callable[[], Program] | None) -> Program | None:
        other = None if write is None else write()
        assert other is None or _shape(other) == _shape(self.main)
        return other

    @property
    def digest(self) -> str:
        programs = (self.main, self.robust, self.latency)
        return " ".join("-" if p is None else p.digest for p in programs)


def _shape(program: Program) -> tuple[object, ...]:
    return program.interface, [(c.tolerance, c.below) for c in program.checks]


@dataclass(frozen=True)
class Numbers:
    """Numbers of V mechanisms of one structure; of a single mechanism V is 1.

    parameters: (V, p);  lanes: constants (V, size, lanes) of each group.
    padding:    (V, size) of each group, for lanes without a chain.
    order:      position of each lane, group by group, among the callers' lanes.
    """

    parameters: np.ndarray
    lanes: tuple[np.ndarray, ...]
    padding: tuple[np.ndarray, ...]
    order: tuple[int, ...]

    @staticmethod
    def none(order: tuple[int, ...]) -> Numbers:
        """No numbers, for a program that takes them as ports."""
        return Numbers(np.empty((1, 0)), (), (), order)

    @staticmethod
    def joined(parts: Sequence[Numbers]) -> Numbers:
        """The mechanisms of all parts, at least one."""
        lanes, padding = (
            tuple(map(np.concatenate, zip(*(getattr(part, name) for part in parts), strict=True)))
            for name in ("lanes", "padding")
        )
        parameters = np.concatenate([part.parameters for part in parts])
        return Numbers(parameters, lanes, padding, parts[0].order)

    def __len__(self) -> int:
        return len(self.parameters)

    def rows(self, rows: np.ndarray | slice) -> Numbers:
        """The numbers of some of the mechanisms."""
        lanes, padding = (tuple(own[rows] for own in each) for each in (self.lanes, self.padding))
        return Numbers(self.parameters[rows], lanes, padding, self.order)

    def single(self, i: int) -> Numbers:
        """The numbers of one mechanism."""
        return self.rows(slice(i, i + 1))
