"""Portable C for small machines: loops over chains, and over steps that a program repeats."""

from __future__ import annotations

from collections.abc import Iterator

from ..backends.c.levelled import LevelledCode
from ..graph.graph import Value
from ..graph.program import Program
from ..graph.repeats import Repeat, segments
from .c_body import Places, ScalarC

LOOP = -1  # in the place of a chain's number: that of the loop


class SmallC(ScalarC, LevelledCode):
    """The statements of `ScalarC`, of every chain and of every repeated step once.

    A chain's value is a number within its loop; what is read elsewhere is kept in an array. What a
    step hands to the next is a variable, under the name of the first block's value.
    """

    def __init__(self, program: Program, places: Places, precision: str) -> None:
        super().__init__(program, places, precision)
        self._parts = list(segments(self.g, self.varying, program.roots))
        self._handed: dict[Value, Value] = {}  # value of a block -> the first block's in its place
        self._loop: set[Value] = set()  # chains' values of the loop that is being printed
        for part in self._parts:
            if isinstance(part, Repeat):
                for block in (part.blocks[0], part.blocks[-1]):
                    self._handed |= {block[i]: part.blocks[0][i] for i in part.carried}
        self._place = self._places_of_values()
        self._arrays = self._kept()
        self._conditions = self._asked_again()

    def lines(self) -> Iterator[str]:
        yield from self._lane_inputs()
        for part in self._parts:
            if isinstance(part, Repeat):
                yield from self._steps(part)
            else:
                yield from self._declared(part)
                yield from self.by_levels(part)

    def _places_of_values(self) -> dict[Value, tuple[int, int]]:
        """The part and level of each value that is printed."""
        place: dict[Value, tuple[int, int]] = {}
        for i, part in enumerate(self._parts):
            values = part.blocks[1] if isinstance(part, Repeat) else part
            place |= {v: (i, level) for v, level in self.levels(values).items()}
        return place

    def _kept(self) -> set[Value]:
        """Chains' values that are read outside the loop that they are of."""
        kept = {v for v in self.program.roots if v in self._place}
        for v, place in self._place.items():
            kept |= {a for a in self.g.nodes[v].args if self._place.get(a, place) != place}
        for part in self._parts:
            if isinstance(part, Repeat):
                kept |= {part.blocks[1][i] for i in part.carried}
                kept |= {v for v in part.carried.values() if v is not None}
        return {v for v in kept if self.g.nodes[v].group is not None}

    def _asked_again(self) -> set[Value]:
        """Values of which it is asked where they are known whether they are 0."""
        conditions = set()
        for v, place in self._place.items():
            node = self.g.nodes[v]
            if node.op == "where" and (when := node.args[0]) in self._place:
                near = self.g.nodes[when].group is None or self._place[when] == place
                if near and when not in self._handed and not self.over_chains(when):
                    conditions.add(when)
        return conditions

    def _declared(self, values: list[Value] | tuple[Value, ...]) -> Iterator[str]:
        names = [f"a{v}[{self._count(v)}]" for v in values if v in self._arrays]
        if names:
            yield f"{self.precision} {', '.join(names)};"

    def _steps(self, repeat: Repeat) -> Iterator[str]:
        first, body = repeat.blocks[:2]
        for i, start in repeat.carried.items():
            yield from self._set(first[i], start, declare=True)
        yield f"for (int pass = 0; pass < {len(repeat.blocks)}; pass++) {{"
        yield from self._declared(body)
        yield from self.by_levels(body)
        for i in repeat.carried:
            yield from self._set(first[i], body[i])
        yield "}"

    def _set(self, v: Value, value: Value | None, declare: bool = False) -> Iterator[str]:
        """Statements that give a value that is handed on another one; None: it has none yet."""
        kind = f"{self.precision} " * declare
        if self.g.nodes[v].group is None:
            yield f"{kind}s{v}{'' if value is None else f' = {self.name(value, 0)}'};"
            return
        if declare:
            yield f"{kind}s{v}[{self._count(v)}];"
        if value is not None:
            yield self._for(self._count(v))
            yield f"s{v}[i] = {self.name(value, LOOP)};"
            yield "}"

    def chains(
        self, group: int, values: list[Value], terms: list[tuple[Value, Value]]
    ) -> Iterator[str]:
        yield self._for(self.counts[group])
        self._loop = set(values)
        yield from self.chain(values, terms, LOOP)
        yield from (f"a{v}[i] = x{v};" for v in values if v in self._arrays)
        self._loop = set()
        yield "}"

    def statements(self, values: list[Value], copy: int) -> Iterator[str]:
        """Definitions, and what is asked of a value again and again: whether it is not 0."""
        done: set[Value] = set()
        for v in values:
            pair = [w for w in self._pair(v, values) if w is not None]
            defined = pair if self.g.nodes[v].op in ("sin", "cos") else [v]
            if v not in done:
                yield from super().statements(defined, copy)
            done.update(defined)
            if v in self._conditions:
                x = self.name(v, copy)
                yield f"const int b{v} = !({x} >= 0 && {x} <= 0);"

    def expression(self, v: Value, copy: int) -> str:
        node = self.g.nodes[v]
        when = node.args[0] if node.op == "where" else None
        if when not in self._conditions:
            return super().expression(v, copy)
        if self.g.nodes[when].group is not None and when not in self._loop:
            return super().expression(v, copy)
        return f"b{when} ? {self.name(node.args[1], copy)} : 0"

    def target(self, v: Value, copy: int) -> str:
        return f"x{v}"

    def name(self, v: Value, copy: int) -> str:
        node = self.g.nodes[v]
        if v in self._handed and node.group is None:
            return f"s{self._handed[v]}"
        if not node.varies or node.op == "const" or node.group is None or v in self._loop:
            return super().name(v, copy)
        array = f"s{self._handed[v]}" if v in self._handed else f"a{v}"
        return f"{array}[{self.lane(copy)}]"

    def lane(self, copy: int) -> str:
        return "i" if copy == LOOP else super().lane(copy)

    def lane_sample(self, first: object, copy: int) -> str:
        return f"in{first}[{self.lane(copy)}]"

    def _lane_inputs(self) -> Iterator[str]:
        """Arrays of what the chains read: arguments or numbers, in the program's order."""
        for v in self.varying:
            node = self.g.nodes[v]
            if node.op == "lane_input":
                first, count = node.data[1], self._count(v)
                assert isinstance(first, int)
                columns = self.places.columns[first : first + count]
                known = "static " * all(c.startswith("(") for c in columns)
                yield f"{known}const {self.precision} in{first}[] = {{{', '.join(columns)}}};"

    def _count(self, v: Value) -> int:
        group = self.g.nodes[v].group
        assert group is not None
        return self.counts[group]

    def _for(self, count: int) -> str:
        return f"for (int i = 0; i < {count}; i++) {{"
