"""A batch: W samples in a vector, chain after chain.

A sample's computation falls into parts: what all chains share, what each chain adds to sums, what
follows from those sums, and so on. Chains join a sum one after the other, by fused multiply-adds
where a term is one, so that few of their values have to be kept. The statements of long chains
run in a loop; what a later part needs of them stays in arrays `x<value>_`.
"""

from __future__ import annotations

from collections.abc import Iterator

from ...graph.graph import Value
from ...graph.operations import REDUCTIONS
from ...graph.program import Program
from .printer import Printer, nested

LONG = 700  # statements of a chain above which one at a time is enough
LONG_UNROLLED = 6000  # statements of all chains above which compilers take long
ABREAST = 2  # chains whose statements alternate, to keep all arithmetic ports busy
TRIGONOMETRY = 12  # operations of half a sine and cosine

Part = tuple[int, int | None]  # phase, and group of chains


class Loops(Printer):
    """The parts of a program as loops."""

    shared = "vec"

    def __init__(self, program: Program, width: int) -> None:
        super().__init__(program, width, list(program.counts), 1)
        self.uses: dict[Value, list[Value]] = {v: [] for v in self.varying}
        for v in self.varying:
            for a in self.g.nodes[v].args:
                if a in self.uses:
                    self.uses[a].append(v)
        self.wanted: set[Value] = set(program.roots)
        self.absorbed: set[Value] = self._absorbed()
        reductions = (v for v in self.varying if self.g.nodes[v].op in REDUCTIONS)
        self.joining: dict[Value, list[Part]] = {
            v: [self._part(t) for _, t in self.lane_terms(v)] for v in reductions
        }
        own: dict[Part, list[Value]] = {
            part: [] for found in self.joining.values() for part in found
        }
        for v in self.varying:
            own.setdefault(self._part(v), []).append(v)
        self.parts: list[tuple[Part, list[Value]]] = sorted(
            own.items(), key=lambda item: self._rank(item[0])
        )
        groups = [group for v in self.varying if (group := self.g.nodes[v].group) is not None]
        unrolled = sum(program.counts[group] for group in groups)
        self.rolled: bool = len(groups) > LONG or unrolled > LONG_UNROLLED
        self.needed_later: set[Value] = self._needed_later() if self.rolled else set()
        self.here: Part = (0, None)

    def function(self, name: str) -> str:
        """`static void name(table, in, at, out)`, for the samples from `at` on."""
        lines = [
            f"static void {name}(const double *restrict table, const double *const *in, size_t at,",
            "    vec *restrict out) {",
        ]
        for v in sorted(self.needed_later):
            group = self.g.nodes[v].group or 0
            lines.append(f"  vec x{v}_[{self.counts[group]}];")
        for part, values in self.parts:
            self.here = part
            own = self.statements(values, 0) if part[1] is None else self._chains(part, values)
            lines += [f"  {s}" for s in own]
        self.here = (-1, None)
        for at, v, lanes in self.program.stored():
            lines += [self._stored(at + c, v, c) for c in range(lanes)]
        return "\n".join([*lines, "}", ""])

    def operations(self) -> int:
        """Vector operations of a block; a fused multiply-add counts one."""
        total = 0
        for v in self.varying:
            node = self.g.nodes[v]
            copies = 1 if node.group is None else self.copies[node.group]
            if node.op in REDUCTIONS:
                # What is absorbed joins the sum by operations of its own.
                total += sum(
                    self.copies[g] for g, t in self.lane_terms(v) if t not in self.absorbed
                )
                total += len(self.shared_terms(v))
            elif node.op in ("sin", "cos"):
                total += TRIGONOMETRY
            elif node.op not in ("neg", "input") and not self._contracted(v):
                total += copies
        return total

    def _contracted(self, v: Value) -> bool:
        """A product that the one addition it is for takes in."""
        if self.g.nodes[v].op != "mul" or v in self.wanted or len(self.uses[v]) != 1:
            return False
        user = self.uses[v][0]
        return self._part(user) == self._part(v) and self.g.nodes[user].op in ("add", "sub", "neg")

    # -- parts -----------------------------------------------------------------------------

    def _part(self, v: Value) -> Part:
        node = self.g.nodes[v]
        return node.phase, node.group

    @staticmethod
    def _rank(part: Part) -> tuple[int, int]:
        """Shared values of a phase come before its chains."""
        return part[0], -1 if part[1] is None else part[1]

    def _absorbed(self) -> set[Value]:
        """Lane values that only one sum over the chains wants: they become steps of that sum."""
        absorbed: set[Value] = set()
        for v in self.varying:
            if self.g.nodes[v].op == "sum":
                for _, t in self.lane_terms(v):
                    self._absorb(t, absorbed)
        return absorbed

    def _absorb(self, v: Value, absorbed: set[Value]) -> None:
        node = self.g.nodes[v]
        steps = {"mul": (), "fma": (2,), "fnma": (2,), "add": (0, 1), "sub": (0, 1)}
        if v not in self.uses or len(self.uses[v]) != 1 or v in self.wanted or node.op not in steps:
            return
        absorbed.add(v)
        for a in (node.args[i] for i in steps[node.op]):
            # An earlier part's own values are not there any more.
            if self._part(a) == self._part(v):
                self._absorb(a, absorbed)

    def _needed_later(self) -> set[Value]:
        """Lane values that a later part, or an output, needs."""
        needed_later = set(self.wanted)
        for v in self.varying:
            node = self.g.nodes[v]
            if node.op not in REDUCTIONS:
                needed_later |= {a for a in node.args if self._part(a) != self._part(v)}
        return {
            v for v in needed_later if self.g.nodes[v].varies and self.g.nodes[v].group is not None
        }

    # -- statements ------------------------------------------------------------------------

    def _chains(self, part: Part, values: list[Value]) -> Iterator[str]:
        """Statements of a group's chains, and the sums that they join."""
        group = part[1]
        assert group is not None
        sums = [
            (v, t) for v in self.joining for _, t in self.lane_terms(v) if self._part(t) == part
        ]
        plain = [v for v in values if v not in self.absorbed]
        count, abreast = self.counts[group], 1 if self.rolled else ABREAST
        yield from (f"vec r{v} = {start};" for v, start in self._started(sums, part))
        if self.rolled:
            yield f"for (int c = 0; c < {count}; c++) {{"
        for first in range(0, 1 if self.rolled else count, abreast):
            some = range(first, min(first + abreast, count))
            rows = [list(self.statements(plain, c)) for c in some]
            yield from (s for row in zip(*rows, strict=True) for s in row)
            for c in some:
                for v, t in sums:
                    yield from self._joined(v, t, c)
        if self.rolled:
            yield from (f"x{v}_[c] = x{v}_0;" for v in plain if v in self.needed_later)
            yield "}"

    def _started(self, sums: list[tuple[Value, Value]], part: Part) -> Iterator[tuple[Value, str]]:
        """What reductions are before the first of a mechanism's chains joins them."""
        for v, _ in sums:
            if min(self.joining[v], key=self._rank) == part:
                yield v, "spread(0.0)" if self.g.nodes[v].op == "sum" else "spread(HUGE_VAL)"

    def _joined(self, v: Value, t: Value, copy: int) -> Iterator[str]:
        """A chain's term joins a reduction."""
        if self.g.nodes[v].op == "least":
            name = self.name(t, copy)
            yield f"r{v} = fmin_v(r{v}, {f'spread({name})' if self.is_scalar(t) else name});"
            return
        for sign, factors in self._steps(t):
            product = " * ".join(self.name(x, copy) for x in factors)
            yield f"r{v} = r{v} {'+' if sign > 0 else '-'} {product};"

    def _steps(self, t: Value, sign: int = 1) -> Iterator[tuple[int, tuple[Value, ...]]]:
        """Signs and factors of what a sum's term adds to it: more than one, if it is absorbed."""
        node = self.g.nodes[t]
        if t not in self.absorbed:
            yield sign, (t,)
        elif node.op in ("add", "sub"):
            yield from self._steps(node.args[0], sign)
            yield from self._steps(node.args[1], sign if node.op == "add" else -sign)
        else:
            if node.op != "mul":
                yield from self._steps(node.args[2], sign)
            yield -sign if node.op == "fnma" else sign, node.args[:2]

    def _stored(self, slot: int, v: Value, copy: int) -> str:
        name = self.name(v, copy)
        return f"  out[{slot}] = {f'spread({name})' if self.is_scalar(v) else name};"

    # -- names -----------------------------------------------------------------------------

    def name(self, v: Value, copy: int) -> str:
        if v in self.needed_later and self._part(v) != self.here:
            return f"x{v}_[{self.lane(copy)}]"
        return super().name(v, copy)

    def lane(self, copy: int) -> str:
        return "c" if self.rolled and self.here[1] is not None else str(copy)

    def sample(self, i: object) -> str:
        return f"load(in[{i}] + at)"

    def lane_sample(self, first: object, copy: int) -> str:
        return f"load(in[{first} + {self.lane(copy)}] + at)"

    def reduction(self, v: Value) -> str:
        shared = []
        for count, t in self.shared_terms(v):
            text = self.repeated(v, t, count)
            shared.append(f"spread({text})" if self.is_scalar(t) else text)
        terms = [f"r{v}", *shared] if self.lane_terms(v) else shared
        return " + ".join(terms) if self.g.nodes[v].op == "sum" else nested("fmin_v", terms)
