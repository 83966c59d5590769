"""One evaluation chain after chain: what the chains share, then each chain's values, which it adds
to the sums over all chains before the next begins. So few values wait for others."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence

from ...graph.graph import Value
from ...graph.operations import REDUCTIONS
from .straight_line import ScalarCode


class LevelledCode(ScalarCode):
    """Statements level by level: a level ends with the sums over chains that the next one takes."""

    def by_levels(self, values: Sequence[Value]) -> Iterator[str]:
        """Statements that define values, whose arguments are among them or are known."""
        levels = self.levels(values)
        for level in range(max(levels.values(), default=0) + 1):
            yield from self._level([v for v in values if levels[v] == level])

    def levels(self, values: Sequence[Value]) -> dict[Value, int]:
        """How many sums over the chains, one on another, each value waits for."""
        levels: dict[Value, int] = {}
        for v in values:
            args = [a for a in self.g.nodes[v].args if a in levels]
            levels[v] = max((levels[a] + self.over_chains(a) for a in args), default=0)
        return levels

    def over_chains(self, v: Value) -> bool:
        """Whether a value is a sum or minimum of terms that differ from chain to chain."""
        return self.g.nodes[v].op in REDUCTIONS and bool(self.lane_terms(v))

    def _level(self, values: list[Value]) -> Iterator[str]:
        sums = [v for v in values if self.over_chains(v)]
        shared = [v for v in values if self.g.nodes[v].group is None and v not in sums]
        yield from self.statements(shared, 0)
        yield from (f"{self.kind(v)} {self.name(v, 0)} = {self._start(v)};" for v in sums)
        for group in range(len(self.copies)):
            own = [v for v in values if self.g.nodes[v].group == group]
            terms = [(v, t) for v in sums for of, t in self.lane_terms(v) if of == group]
            if own or terms:
                yield from self.chains(group, own, terms)

    @abstractmethod
    def chains(
        self, group: int, values: list[Value], terms: list[tuple[Value, Value]]
    ) -> Iterator[str]:
        """Statements of a family's chains, one after the other; terms: a sum, and what joins it."""

    def chain(
        self, values: list[Value], terms: list[tuple[Value, Value]], copy: int
    ) -> Iterator[str]:
        """Statements of one chain."""
        yield from self.statements(values, copy)
        for v, t in terms:
            total = self.name(v, 0)
            yield f"{total} = {self.joined(v, [total, self.name(t, copy)])};"

    def _start(self, v: Value) -> str:
        terms = [self.repeated(v, t, count) for count, t in self.shared_terms(v)]
        return self.joined(v, terms or ["0" if self.g.nodes[v].op == "sum" else "HUGE_VAL"])
