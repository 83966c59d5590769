"""A program by numpy: node by node, lanes as a leading axis, samples in blocks.

It needs no compiler, and is what the other backends are tested against.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np

from ..graph.graph import VARYING, Value
from ..graph.operations import OPERATIONS, REDUCTIONS
from ..graph.program import Interface, Numbers, Program, Programs
from .kernel import AGAIN, NONE, OK, KernelValues, columns_of, results_of, run_by_variant
from .threads import workers

BLOCK = 2048  # samples: few enough that what is alive stays in a cache


class NumpyKernel:
    """A program and its robust variant on the numbers of its mechanisms."""

    name = "numpy"

    def __init__(
        self, variants: Programs, numbers: Numbers, prepared: _Runner | None = None
    ) -> None:
        """Args: prepared: the main program, on other numbers."""
        self.interface: Interface = variants.main.interface
        self.order: tuple[int, ...] = numbers.order
        own = numbers.single(0)
        self._main = prepared.renumbered(own) if prepared else _Runner(variants.main, own)
        self._variants, self._numbers = variants, numbers

    @cached_property
    def _robust(self) -> _Runner | None:
        robust = self._variants.robust
        return None if robust is None else _Runner(robust, self._numbers)

    def renumbered(self, numbers: Numbers) -> NumpyKernel:
        """As of `Kernel`."""
        return NumpyKernel(self._variants, numbers, self._main)

    def run(
        self,
        inputs: Mapping[str, np.ndarray],
        threads: int | None = None,
        without: frozenset[str] = NONE,
    ) -> KernelValues:
        workers(threads)
        if len(self._numbers) > 1:
            return run_by_variant(self, self._numbers, inputs, threads, without)
        face = self.interface
        count, columns = columns_of(face, inputs, self.order)
        results = np.empty((sum(face.width(r) for r in face.results), count))
        status = np.empty(count, dtype=np.uint8)
        with np.errstate(all="ignore"):
            for start in range(0, count, BLOCK):
                part = slice(start, min(start + BLOCK, count))
                some = [column[part] for column in columns]
                status[part] = self._main(some, results[:, part])
                again = np.flatnonzero(status[part] == AGAIN) + start
                if again.size and self._robust is not None:
                    better = np.empty((len(results), again.size))
                    status[again] = self._robust([column[again] for column in columns], better)
                    results[:, again] = better
        return KernelValues(results_of(face, results, self.order), status).without(without)


class _Runner:
    """A program as a list of numpy calls into buffers; what does not vary is computed once."""

    def __init__(self, program: Program, numbers: Numbers) -> None:
        self._program = program
        self._place: dict[Value, int] = {}
        self._fixed: list[Any] = []  # the first places
        self._fix(numbers)
        self._buffers: list[int] = []  # lanes of the places after those
        self._leaves: list[tuple[int, int]] = []  # place and column
        self._steps: list[tuple[Callable[..., Any], tuple[int, ...], int]] = []
        self._allocate([v for v in program.order if program.graph.nodes[v].varies])

    def renumbered(self, numbers: Numbers) -> _Runner:
        """The same calls on other numbers."""
        other = copy(self)
        other._fix(numbers)
        return other

    def _fix(self, numbers: Numbers) -> None:
        """Compute what does not vary; each has the same place whatever the numbers."""
        self._fixed, nodes = [], self._program.graph.nodes
        with np.errstate(all="ignore"):
            for v in self._program.order:
                node = nodes[v]
                if node.varies:
                    continue
                self._place[v] = len(self._fixed)
                given = [self._fixed[self._place[a]] for a in node.args]
                if not given:
                    self._fixed.append(_number(node.op, node.data, numbers))
                elif node.op == "sum":
                    self._fixed.append(self._summed(node.args, given))
                elif node.op in REDUCTIONS:
                    self._fixed.append(np.empty(1))
                    self._call(v)(*given, out=self._fixed[-1])
                else:
                    self._fixed.append(OPERATIONS[node.op].numpy(*given))

    def _summed(self, args: Sequence[Value], terms: Sequence[Any]) -> np.float64:
        """A sum over lanes that is rounded once: what is symmetric is exactly zero."""
        nodes, counts = self._program.graph.nodes, self._program.counts
        each = (
            np.ravel(term) if nodes[a].group is not None else count * np.ravel(term)
            for a, term, count in zip(args, terms, counts, strict=True)
        )
        found = [float(x) for part in each for x in part]
        return np.float64(math.fsum(found) if np.isfinite(found).all() else sum(found))

    def fixed(self) -> list[np.ndarray]:
        """What does not vary of every result, (lanes,) each, in the order of `Program.stored`."""
        return [
            np.broadcast_to(np.ravel(self._fixed[self._place[v]]), lanes)
            for _, v, lanes in self._program.stored()
        ]

    def _lanes(self, v: Value) -> int:
        group = self._program.graph.nodes[v].group
        return 0 if group is None else self._program.counts[group]

    def _allocate(self, varying: list[Value]) -> None:
        """A place for every value; what is not wanted any more leaves its own to others."""
        nodes = self._program.graph.nodes
        last = {a: v for v in varying for a in nodes[v].args}
        wanted = set(self._program.roots)
        free: dict[int, list[int]] = {}
        for v in varying:
            node, lanes = nodes[v], self._lanes(v)
            places = free.setdefault(lanes, [])
            if places and node.args:
                place = places.pop()
            else:
                place = len(self._fixed) + len(self._buffers)
                self._buffers.append(lanes)
            self._place[v] = place
            if node.op in VARYING:
                self._leaves.append((place, int(node.data[-1])))  # type: ignore[call-overload]
            else:
                args = tuple(self._place[a] for a in node.args)
                self._steps.append((self._call(v), args, place))
            for a in set(node.args):
                if nodes[a].varies and last[a] == v and a not in wanted:
                    free.setdefault(self._lanes(a), []).append(self._place[a])

    def _call(self, v: Value) -> Callable[..., Any]:
        """What computes a value from those of its arguments, into `out`."""
        node = self._program.graph.nodes[v]
        if node.op not in REDUCTIONS:
            return OPERATIONS[node.op].into
        nodes, counts = self._program.graph.nodes, self._program.counts
        lanes = [nodes[a].group is not None for a in node.args]
        join = np.add if node.op == "sum" else np.minimum

        def reduced(*terms: Any, out: np.ndarray) -> None:
            for i, (term, own, count) in enumerate(zip(terms, lanes, counts, strict=True)):
                if own:
                    part = join.reduce(term, axis=0)
                else:
                    part = count * term if join is np.add else term
                if i:
                    join(out, part, out=out)
                else:
                    out[...] = part

        return reduced

    def __call__(self, columns: list[np.ndarray], results: np.ndarray) -> np.ndarray:
        """Fill the columns of all results, (width, N); returns the statuses."""
        count = len(columns[0]) if columns else 0
        # Two samples at least: numpy adds the lanes of a single one in another order.
        size = max(count, 2)
        values = [*self._fixed, *(np.empty((n, size) if n else size) for n in self._buffers)]
        for place, column in self._leaves:
            for i, row in enumerate(np.atleast_2d(values[place])):
                row[:count] = columns[column + i]
                row[count:] = columns[column + i][:1] if count else 0.0
        for call, args, out in self._steps:
            call(*[values[a] for a in args], out=values[out])
        for at, v, lanes in self._program.stored():
            if at < len(results):
                a = np.broadcast_to(values[self._place[v]], (lanes, size))
                results[at : at + lanes] = a[:, :count]
        return self._status(values, count, size)

    def _status(self, values: list[Any], count: int, size: int) -> np.ndarray:
        status = np.full(count, OK, dtype=np.uint8)
        for check in self._program.checks:
            value = np.broadcast_to(values[self._place[check.value]], size)[:count]
            below = AGAIN if check.below is None else check.below
            own = np.where(value >= check.tolerance, OK, np.where(value < 0, below, AGAIN))
            # What is sure comes before what is in doubt.
            better = (status == OK) | ((status == AGAIN) & (own != OK) & (own != AGAIN))
            status = np.where(better, own, status).astype(np.uint8)
        return status


def fixed_results(program: Program, numbers: Numbers) -> dict[str, np.ndarray]:
    """Results of a program without ports, by name: (*shape), or (*shape, lanes) of lanes."""
    with np.errstate(all="ignore"):
        found = iter(_Runner(program, numbers).fixed())
    return {
        r.name: np.array([next(found) for _ in range(math.prod(r.shape) * max(1, len(r.groups)))])
        for r in program.interface.results
    }


def _number(op: str, data: tuple[Any, ...], numbers: Numbers) -> Any:
    if op == "const":
        return np.float64(data[0])
    if op == "parameter":
        return np.float64(numbers.parameters[0, data[0]])
    group, i = data
    return numbers.lanes[group][0, i][:, None]
