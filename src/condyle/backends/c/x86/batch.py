"""A batch's program as instructions: samples in the lanes, chain after chain."""

from __future__ import annotations

from ....graph.graph import Value
from ..loops import Loops
from .listing import Listing, Name, contracted
from .lower import Lowering, integer


def batch(loops: Loops) -> Listing:
    """The instructions of one step, in the program's order."""
    return _Batch(loops).run()


class _Batch(Lowering):
    """All values are vectors of samples; sums grow from chain to chain."""

    def __init__(self, loops: Loops) -> None:
        super().__init__(loops)
        self.loops = loops
        self.sums: dict[Value, Name] = {}

    def run(self) -> Listing:
        loops = self.loops
        for (_, group), values in loops.parts:
            if group is None:
                for v in values:
                    self.define(v, 0)
                continue
            joined = loops.sums_of(values)
            for chain in range(loops.counts[group]):
                for v in values:
                    if v not in loops.absorbed:
                        self.define(v, chain)
                for v, term in joined:
                    self._join(v, term, chain)
        for slot, v, chain in loops.outputs():
            self.listing.store(slot, self.named(v, chain))
        self.listing.code = contracted(self.listing.code)
        return self.listing

    def add(self, op: str, *args: Name, data: object = None) -> Name:
        return self.listing.add(op, *args, data=data)

    def fixed(self, v: Value, copy: int) -> Name:
        return self.listing.place("table", self.loops.slot(v, copy))

    def given(self, v: Value, copy: int) -> Name:
        op, data = self.nodes[v].op, self.nodes[v].data
        column = integer(data[0]) if op == "input" else integer(data[1]) + copy
        return self.listing.place("sample", column)

    def estimates(self) -> bool:
        return self.loops.width == 8

    def _join(self, v: Value, term: Value, chain: int) -> None:
        """A chain's term joins a reduction."""
        if self.nodes[v].op == "least":
            own = self.named(term, chain)
            self.sums[v] = self.add("min", self.sums[v], own) if v in self.sums else own
            return
        for sign, factors in self.loops.steps(term):
            args = [self.named(x, chain) for x in factors]
            self.sums[v] = self.plus(self.sums.get(v), sign, args)

    def reduction(self, v: Value) -> Name:
        return self.with_shared(v, self.sums.get(v))
