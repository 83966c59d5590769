"""One evaluation as a straight line: chains in the lanes of vectors, shared values scalar."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ...graph.graph import Value
from ...graph.program import Program
from ...graph.schedule import ready_times, scheduled
from .printer import Printer, nested, number, padded_counts

WAIT = 12  # cycles between sums that are worth waiting for
HUGE = {"double": 1e300, "float": 1e37}  # numbers are kept within, and 1 over it


class Straight(Printer):
    """Statements in the order of `scheduled`; lanes beyond a vector's width are further copies."""

    shared = "double"

    def __init__(self, program: Program, width: int, precision: str = "double") -> None:
        copies = [count // width for count in padded_counts(program, width)]
        super().__init__(program, width, copies, width)
        self.precision = precision

    def number(self, value: object) -> str:
        """A number in this precision."""
        assert isinstance(value, float)
        huge = HUGE[self.precision]
        if 0 < abs(value) < 1 / huge:
            value = math.copysign(1 / huge, value)
        text = number(max(-huge, min(huge, value)) if abs(value) < float("inf") else value)
        if self.precision == "double" or ("(" not in text and not text[0].isdigit()):
            return text
        return f"{text[:-1]}f)" if text.endswith(")") and text[1] == "-" else f"{text}f"

    def name(self, v: Value, copy: int) -> str:
        node = self.g.nodes[v]
        return self.number(node.data[0]) if node.op == "const" else super().name(v, copy)

    def function(self, name: str) -> str:
        """`int name(table, in, out)`: whether every check is met beyond doubt."""
        head = f"HIDDEN int {name}(const double *restrict table, const double *restrict in, "
        head += "double *restrict out) {"
        checks = self.program.checks
        met = (f"({self.name(c.value, 0)} >= {c.tolerance!r})" for c in checks)
        sure = f"  return {' & '.join(met) or '1'};"
        return "\n".join([head, *self._body(), *self.outputs(), sure, "}", ""])

    def _body(self) -> Iterator[str]:
        bundles = {bundle[0]: bundle for bundle in self.bundles()}
        order = scheduled(self.g, self.varying, list(bundles.values()))
        done: set[Value] = set()
        for v in order:
            if v in done:
                continue
            if v in bundles:
                yield f"  {self._sums(bundles[v])}"
                continue
            node = self.g.nodes[v]
            pair = [v]
            if node.op in ("sin", "cos"):
                pair = [w for w in self._pair(v, order) if w is not None]
            done.update(pair)
            for c in range(1 if node.group is None else self.copies[node.group]):
                yield from (f"  {s}" for s in self.statements(pair, c))

    def bundles(self) -> list[list[Value]]:
        """Sums over the lanes by fours and twos, of those that are ready at about one time."""
        ready = ready_times(self.g, self.varying)
        sums = [v for v in self.varying if self.g.nodes[v].op == "sum" and self.lane_terms(v)]
        waiting = sorted((v for v in sums if not self.shared_terms(v)), key=lambda v: ready[v])
        bundles = []
        while waiting:
            near = [v for v in waiting if ready[v] <= ready[waiting[0]] + WAIT]
            size = 4 if len(near) >= 4 else 2 if len(near) >= 2 else 1
            if size > 1:
                bundles.append(waiting[:size])
            waiting = waiting[size:]
        return bundles

    def _sums(self, bundle: list[Value]) -> str:
        names = [f"x{v}" for v in bundle]
        terms = [" + ".join(self._lane_names(v)) for v in bundle]
        targets = ", ".join(f"&{name}" for name in names)
        call = f"lanes_sums_{len(bundle)}({', '.join(terms)}, {targets})"
        return f"double {', '.join(names)}; {call};"

    def _lane_names(self, v: Value) -> list[str]:
        """Vectors whose lanes a reduction takes together; what is in none of a chain counts not.

        A vector that the chains of a group do not fill reads its other lanes from where the next
        group's samples are.
        """
        rest, names = "0.0" if self.g.nodes[v].op == "sum" else "HUGE_VAL", []
        for group, t in self.lane_terms(v):
            names += [self.name(t, c) for c in range(self.copies[group])]
            if used := self.counts[group] % self.width:
                names[-1] = f"lanes_used({names[-1]}, {used}, {rest})"
        return names

    def sample(self, i: object) -> str:
        return f"in[{i}]"

    def reduction(self, v: Value) -> str:
        own, lanes = self.g.nodes[v].op == "sum", self._lane_names(v)
        if lanes:
            lanes = self._across(own, lanes)
        return self.joined(
            v, [*lanes, *(self.repeated(v, t, count) for count, t in self.shared_terms(v))]
        )

    def joined(self, v: Value, terms: list[str]) -> str:
        """The sum or minimum of a reduction's terms."""
        return " + ".join(terms) if self.g.nodes[v].op == "sum" else nested("fmin_s", terms)

    def _across(self, sums: bool, lanes: list[str]) -> list[str]:
        """What the lanes of vectors bring to a sum or minimum."""
        return [
            f"lanes_sum({' + '.join(lanes)})" if sums else f"lanes_least({nested('fmin_v', lanes)})"
        ]

    def lane_sample(self, first: object, copy: int) -> str:
        return f"load(in + {first} + {copy * self.width})"

    def outputs(self) -> Iterator[str]:
        """What is stored: results, then checks."""
        for at, v, count in self.program.stored():
            for c, first in enumerate(range(0, count, self.width)):
                yield self._stored(at + first, v, c, min(self.width, count - first))

    def _stored(self, at: int, v: Value, copy: int, used: int) -> str:
        name = self.name(v, copy)
        if used == 1 and self.g.nodes[v].group is None:
            return f"  out[{at}] = {name};"
        row = f"spread({name})" if self.is_scalar(v) else name
        whole = used == self.width
        return (
            f"  store(out + {at}, {row});" if whole else f"  store_some(out + {at}, {row}, {used});"
        )


class ScalarCode(Straight):
    """Every chain's statements by themselves, without vectors, in `double` or `float`."""

    def kind(self, v: Value) -> str:
        return self.precision

    def is_scalar(self, v: Value) -> bool:
        return True

    def bundles(self) -> list[list[Value]]:
        return []

    def _across(self, sums: bool, lanes: list[str]) -> list[str]:
        return lanes

    @property
    def operations(self) -> int:
        """Floating-point operations; a fused multiply-add counts one, sine with cosine too."""
        total = 0
        for v in self.varying:
            node = self.g.nodes[v]
            if node.op in ("sum", "least"):
                total += sum(self.counts[g] for g, _ in self.lane_terms(v)) - 1
            elif node.op not in ("input", "lane_input", "neg"):
                total += 1 if node.group is None else self.counts[node.group]
        return total
