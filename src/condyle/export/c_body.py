"""A program's body as C without a loop: portable scalar code, or chains in vector types.

Both are straight lines of the backend, with arrays of their own for what goes in and out.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from ..backends.c.straight_line import ScalarCode as Plain
from ..backends.c.straight_line import Straight
from ..graph.graph import Value
from ..graph.program import Output, Program


@dataclass(frozen=True)
class Places:
    """Arrays in the order of the mechanism file; a program's lanes stand family by family.

    columns: C for each input of the program.
    names:   result -> its array in C; absent ones are not computed.
    order:   where each lane of the program stands in the mechanism file.
    """

    columns: tuple[str, ...]
    names: Mapping[str, str]
    order: tuple[int, ...]

    def result(self, name: str, entry: int, lane: int | None) -> str:
        """C for one number of a result, of a lane if it has lanes."""
        at = entry if lane is None else entry * len(self.order) + self.order[lane]
        return f"{self.names[name]}[{at}]"


class Body(Straight):
    """What both have in common: where numbers come from and go to."""

    def __init__(self, program: Program, width: int, places: Places, precision: str) -> None:
        super().__init__(program, width, precision)
        self.places = places

    def lines(self) -> Iterator[str]:
        """Statements that define every value."""
        yield from (line.strip() for line in self._body())

    def statements(self, values: list[Value], copy: int) -> Iterator[str]:
        wanted = [v for v in values if v not in self.merged]
        yield from super().statements(wanted, copy)

    @cached_property
    def merged(self) -> set[Value]:
        """Roots that only their inverses are wanted of, which are computed at once."""
        roots = {v for v in self.varying if self.g.nodes[v].op == "sqrt"} - set(self.program.roots)
        for v in self.varying:
            node = self.g.nodes[v]
            if not (node.op == "div" and self.is_inverse_root(v)):
                roots -= set(node.args)
        return roots

    def check(self, i: int) -> str:
        """The value of a check."""
        return self.name(self.program.checks[i].value, 0)

    def stores(self) -> Iterator[str]:
        """Statements that write the results."""
        starts = [sum(self.counts[:g]) for g in range(len(self.counts))]
        for o in self.program.outputs:
            if o.name not in self.places.names:
                continue
            for i, entry in enumerate(o.entries):
                for group, v in enumerate(entry):
                    if v is None:
                        continue
                    if o.lanes:
                        yield from self._lanes_stored(o, i, v, group, starts[group])
                    else:
                        yield f"{self.places.result(o.name, i, None)} = {self.name(v, 0)};"

    @abstractmethod
    def _lanes_stored(
        self, o: Output, entry: int, v: Value, group: int, start: int
    ) -> Iterator[str]:
        """What keeps a result that differs from lane to lane."""

    def sample(self, i: object) -> str:
        assert isinstance(i, int)
        return self.places.columns[i]


class ScalarC(Body, Plain):
    """Portable: every chain's statements by themselves, in `double` or `float`."""

    def __init__(self, program: Program, places: Places, precision: str) -> None:
        super().__init__(program, 1, places, precision)

    def lane_sample(self, first: object, copy: int) -> str:
        assert isinstance(first, int)
        return self.places.columns[first + copy]

    def _lanes_stored(
        self, o: Output, entry: int, v: Value, group: int, start: int
    ) -> Iterator[str]:
        for c in range(self.counts[group]):
            yield f"{self.places.result(o.name, entry, start + c)} = {self.name(v, c)};"


class Wide(Body):
    """Chains in the lanes of GCC's vector types, in `double`; for least latency."""

    def __init__(self, program: Program, places: Places, width: int) -> None:
        super().__init__(program, width, places, "double")

    def lane_sample(self, first: object, copy: int) -> str:
        assert isinstance(first, int)
        some = range(first + copy * self.width, first + (copy + 1) * self.width)
        known = self.places.columns
        return f"(vec){{{', '.join(known[i] if i < len(known) else '0.0' for i in some)}}}"

    def _lanes_stored(
        self, o: Output, entry: int, v: Value, group: int, start: int
    ) -> Iterator[str]:
        for c in range(self.copies[group]):
            used = min(self.width, self.counts[group] - c * self.width)
            places = [
                self.places.result(o.name, entry, start + c * self.width + i) for i in range(used)
            ]
            plain = self.is_scalar(v)
            if not plain and _in_a_row(places):
                yield f"store_some(&{places[0]}, {self.name(v, c)}, {used});"
                continue
            for i, place in enumerate(places):
                yield f"{place} = {self.name(v, c)}{'' if plain else f'[{i}]'};"


def _in_a_row(places: list[str]) -> bool:
    at = [int(place.rpartition("[")[2].rstrip("]")) for place in places]
    return at == list(range(at[0], at[0] + len(at)))
