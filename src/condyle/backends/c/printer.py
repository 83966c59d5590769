"""What a value of a program looks like in C."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

from ...graph.graph import Graph, Value
from ...graph.operations import OPERATIONS, REDUCTIONS
from ...graph.program import Program

INFIX = {name: op.infix for name, op in OPERATIONS.items() if op.infix}


@dataclass
class PreparedValues:
    """Values that `prepare` computes: shared ones, then those of each group's lanes."""

    shared: dict[Value, int] = field(default_factory=dict)
    lanes: list[dict[Value, int]] = field(default_factory=list)

    @staticmethod
    def of(program: Program) -> PreparedValues:
        """Fixed values that varying ones (or outputs) use."""
        g = program.graph
        table = PreparedValues(lanes=[{} for _ in program.counts])
        used = {a for v in program.order if g.nodes[v].varies for a in g.nodes[v].args}
        used |= set(program.roots)
        for v in program.order:
            node = g.nodes[v]
            if node.varies or v not in used or node.op == "const":
                continue
            slots = table.shared if node.group is None else table.lanes[node.group]
            slots[v] = len(slots)
        return table


class Printer(ABC):
    """Names and statements of a program's values.

    shared: C's type of values that all chains share.
    copies: how often the statements of each group's lanes are there.
    stride: lanes in a copy.
    """

    shared: ClassVar[str]

    def __init__(self, program: Program, width: int, copies: list[int], stride: int) -> None:
        self.program: Program = program
        self.g: Graph = program.graph
        self.width: int = width
        self.copies: list[int] = copies
        self.stride: int = stride
        self.counts: tuple[int, ...] = program.counts
        self.padded: list[int] = padded_counts(program, width)
        self.varying: list[Value] = [v for v in program.order if self.g.nodes[v].varies]
        self.fixed: list[Value] = [v for v in program.order if not self.g.nodes[v].varies]
        self.table: PreparedValues = PreparedValues.of(program)
        self.starts: list[int] = []
        start = len(self.table.shared)
        for lanes, padded in zip(self.table.lanes, self.padded, strict=True):
            self.starts.append(start)
            start += len(lanes) * padded
        self.table_size = start

    def statements(self, values: list[Value], copy: int) -> Iterator[str]:
        """Definitions of values, in their order; sine and cosine of one angle together."""
        done: set[Value] = set()
        for v in values:
            node = self.g.nodes[v]
            if v in done:
                continue
            kind = self.kind(v)
            if node.op not in ("sin", "cos"):
                yield f"const {kind} {self.target(v, copy)} = {self.expression(v, copy)};"
                continue
            sine, cosine = self._pair(v, values)
            done |= {w for w in (sine, cosine) if w is not None}
            names = [
                f"unused{v}_{copy}" if w is None else self.target(w, copy) for w in (sine, cosine)
            ]
            angle = self.operands(v, copy)[0]
            yield (
                f"{kind} {', '.join(names)}; "
                f"sincos{_suffix(kind)}({angle}, {', '.join('&' + n for n in names)});"
            )

    def _pair(self, v: Value, values: list[Value]) -> tuple[Value | None, Value | None]:
        """Sine and cosine of the angle of `v`, as far as they are among the values."""
        angle = self.g.nodes[v].args
        found = {self.g.nodes[w].op: w for w in values if self.g.nodes[w].args == angle}
        return found.get("sin"), found.get("cos")

    def target(self, v: Value, copy: int) -> str:
        """The name that a value is defined by."""
        return f"x{v}" if self.g.nodes[v].group is None else f"x{v}_{copy}"

    def name(self, v: Value, copy: int) -> str:
        """How a value is referred to, in some copy of its group's statements."""
        node = self.g.nodes[v]
        if node.op == "const":
            return number(node.data[0])
        if node.varies:
            return self.target(v, copy)
        if node.group is None:
            return f"table[{self.slot(v)}]"
        at = f"{self.slot(v)} + {self.lane(copy)}"
        return f"table[{at}]" if self.stride == 1 else f"load(table + {at})"

    def slot(self, v: Value, lane: int = 0) -> int:
        """Where the table has a fixed value."""
        group = self.g.nodes[v].group
        if group is None:
            return self.table.shared[v]
        return self.starts[group] + self.table.lanes[group][v] * self.padded[group] + lane

    def lane(self, copy: int) -> str:
        """First lane of a copy."""
        return str(copy * self.stride)

    def expression(self, v: Value, copy: int) -> str:
        """What a value is computed by."""
        node = self.g.nodes[v]
        if node.op == "input":
            return self.sample(node.data[0])
        if node.op == "lane_input":
            return self.lane_sample(node.data[1], copy)
        if node.op in REDUCTIONS:
            return self.reduction(v)
        if node.op == "div" and self.is_inverse_root(v):
            root = self.g.nodes[node.args[1]]
            return f"rsqrt{_suffix(self.kind(v))}({self.name(root.args[0], copy)})"
        if node.op in (*INFIX, "fma", "fnma", "neg"):
            return arithmetic(node.op, [self.name(a, copy) for a in node.args])
        return f"{node.op}{_suffix(self.kind(v))}({', '.join(self.operands(v, copy))})"

    def kind(self, v: Value) -> str:
        """C's type of a varying value."""
        return self.shared if self.g.nodes[v].group is None else "vec"

    def operands(self, v: Value, copy: int) -> list[str]:
        """Arguments of a function; where it takes vectors, scalars are spread."""
        vector = self.kind(v) == "vec"
        names = ((a, self.name(a, copy)) for a in self.g.nodes[v].args)
        return [f"spread({name})" if vector and self.is_scalar(a) else name for a, name in names]

    def parameter(self, i: Any) -> str:
        """A number of the mechanism, in `prepare`."""
        return f"par[{i}]"

    def lane_number(self, group: Any, i: Any) -> str:
        """A number of the chain at index i, in `prepare`."""
        return f"lane[{group}][{i} * {self.padded[group]} + i]"

    @abstractmethod
    def sample(self, i: object) -> str:
        """A sample's input."""

    @abstractmethod
    def lane_sample(self, first: object, copy: int) -> str:
        """A sample's input of some lanes, which stand from column `first` on."""

    @abstractmethod
    def reduction(self, v: Value) -> str:
        """A sum or minimum over the lanes."""

    def lane_terms(self, v: Value) -> list[tuple[int, Value]]:
        """Group and value of a reduction's terms that differ from lane to lane."""
        groups = ((self.g.nodes[t].group, t) for t in self.g.nodes[v].args)
        return [(group, t) for group, t in groups if group is not None]

    def shared_terms(self, v: Value) -> list[tuple[int, Value]]:
        """Number of chains and value of a reduction's terms that are the same in all lanes."""
        terms = zip(self.counts, self.g.nodes[v].args, strict=True)
        return [(count, t) for count, t in terms if self.g.nodes[t].group is None]

    def repeated(self, v: Value, term: Value, count: int) -> str:
        """What `count` equal lanes bring to a reduction."""
        name = self.name(term, 0)
        return f"{count} * {name}" if self.g.nodes[v].op == "sum" else name

    def is_inverse_root(self, v: Value) -> bool:
        top, bottom = (self.g.nodes[a] for a in self.g.nodes[v].args)
        return top.op == "const" and top.data[0] == 1.0 and bottom.op == "sqrt" and bottom.varies

    def is_scalar(self, v: Value) -> bool:
        """Whether a value is a plain double where a vector is being computed."""
        node = self.g.nodes[v]
        if node.op == "const":
            return True
        if not node.varies:
            return node.group is None or self.stride == 1
        return self.kind(v) == "double"


def padded_counts(program: Program, width: int) -> list[int]:
    """Chains of each group, filled up to whole vectors."""
    return [-(-count // width) * width for count in program.counts]


def nested(function: str, terms: list[str]) -> str:
    """Calls of a function of two arguments, one inside the other."""
    text = terms[0]
    for term in terms[1:]:
        text = f"{function}({text}, {term})"
    return text


def arithmetic(op: str, args: list[str]) -> str:
    """An operation that C writes with signs."""
    if op == "neg":
        return f"-{args[0]}"
    if op in INFIX:
        return f"{args[0]} {INFIX[op]} {args[1]}"
    return f"{args[2]} {'+' if op == 'fma' else '-'} {args[0]} * {args[1]}"


def number(value: object) -> str:
    assert isinstance(value, float)
    if not math.isfinite(value):
        return "NAN" if math.isnan(value) else "HUGE_VAL" if value > 0 else "(-HUGE_VAL)"
    text = repr(value)
    return f"({text})" if value < 0 else text


def _suffix(kind: str) -> str:
    return "_v" if kind == "vec" else "_s"
