"""Steps that a program takes several times, found in the order of its values.

An iteration of fixed length is written out in a graph: block after block of values with the same
operations, whose arguments are of the block itself, of the block before, or of before all blocks.
Programs that are to be small are printed with loops in their places.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .graph import Graph, Value

LEAST = 20  # values of a block that is worth a loop
FEWEST = 3  # blocks of a repeat


@dataclass(frozen=True)
class Repeat:
    """Blocks of one shape, each with arguments that the block before has in the same places.

    blocks:  each block's values, in one order.
    carried: place in a block of what the next block takes -> what the first one takes instead; of
             what is used after the last block alone None.
    """

    blocks: tuple[tuple[Value, ...], ...]
    carried: dict[int, Value | None]


def segments(
    graph: Graph, values: Sequence[Value], roots: Sequence[Value]
) -> Iterator[list[Value] | Repeat]:
    """Values, arguments first, as lists of what is done once, and repeats between them."""
    search = _Search(graph, sorted(values), roots)
    yield from search.segments(0, len(search.order))


class _Search:
    def __init__(self, graph: Graph, order: list[Value], roots: Sequence[Value]) -> None:
        self.order = order
        place = {v: i for i, v in enumerate(order)}
        nodes = [graph.nodes[v] for v in order]
        numbers: dict[object, int] = {}
        keys = [(n.op, n.group, n.data, len(n.args)) for n in nodes]
        self.shape = np.array([numbers.setdefault(k, len(numbers)) for k in keys], dtype=np.int64)
        width = max((len(n.args) for n in nodes), default=0)
        self.far = len(order)  # arguments that are no value of the order stand beyond it
        self.args = np.full((len(order), width), -1, dtype=np.int64)
        self.last = np.full(len(order), -1, dtype=np.int64)  # where each is an argument last
        for i, node in enumerate(nodes):
            places = [place.get(a, self.far + a) for a in node.args]
            self.args[i, : len(places)] = places
            self.last[[a for a in places if a < self.far]] = i
        self.last[[place[v] for v in roots if v in place]] = len(order)

    def segments(self, low: int, high: int) -> Iterator[list[Value] | Repeat]:
        """Segments of a part of the order."""
        found = self._longest(low, high)
        if found is None:
            yield self.order[low:high]
            return
        start, repeat = found
        yield from self.segments(low, start)
        yield repeat
        yield from self.segments(start + len(repeat.blocks) * len(repeat.blocks[0]), high)

    def _longest(self, low: int, high: int) -> tuple[int, Repeat] | None:
        """The repeat that leaves out most values, and where it begins; None without any."""
        best = (0, 0, 0)  # length of the run, period, begin
        for period in range(LEAST, (high - low) // FEWEST + 1):
            shape = self.shape[low:high]
            for first, size in _runs(shape[period:] == shape[:-period], max(period, best[0] + 1)):
                a = self.args[low + first : low + first + size]
                b = self.args[low + first + period : low + first + period + size]
                alike = ((a == b) | (b == a + period)).all(axis=1)
                for begin, run in _runs(alike, max(period, best[0] + 1)):
                    best = run, period, low + first + begin
        run, period, begin = best
        if not run:
            return None
        # One block more before the run may differ by what it takes from before all blocks.
        starts = range(max(begin - period, low), begin + run % period + 1)
        repeats = [(s, self._repeat(s, period, begin + run + period)) for s in starts]
        good = [(s, r) for s, r in repeats if r is not None]
        return max(good, key=lambda p: (len(p[1].blocks), -len(p[1].carried)), default=None)

    def _repeat(self, start: int, period: int, end: int) -> Repeat | None:
        """The repeat that begins at a place and ends before another; None where it is none."""
        count = (end - start) // period
        if count < FEWEST:
            return None
        stop = start + (count - 1) * period  # where the last block begins
        first, second = self.args[start : start + period], self.args[start + period :][:period]
        before = (second >= start) & (second < start + period)
        if ((first != second) & (second != first + period) & ~before).any():
            return None
        carried: dict[int, Value | None] = {}
        for place, instead in zip(second[before].tolist(), first[before].tolist(), strict=True):
            value = self.order[instead] if instead < self.far else instead - self.far
            if start <= instead < self.far or carried.setdefault(place - start, value) != value:
                return None
        # Of a block the next one takes values; of the last alone others do.
        block = np.arange(stop - start) // period
        if (self.last[start:stop] >= start + (block + 2) * period).any():
            return None
        after = np.flatnonzero(self.last[stop : stop + period] >= stop + period)
        carried |= {i: None for i in after.tolist() if i not in carried}
        blocks = (self.order[start + i * period :][:period] for i in range(count))
        return Repeat(tuple(map(tuple, blocks)), carried)


def _runs(true: np.ndarray, least: int) -> Iterator[tuple[int, int]]:
    """Begin and length of each run of so many or more."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], true.astype(np.int8), [0]])))
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if end - begin >= least:
            yield begin, end - begin
