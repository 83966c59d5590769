"""A program as C: one evaluation with chains in the lanes, and a batch with samples in them.

    prepare(numbers, table)          what does not change from sample to sample, once
    one(table, in, out)              least latency: shared values scalar, lane values vectors
    batch(table, in, stride, ...)    most throughput: all values vectors over W samples

Both shapes are printed from the same graph. `Shape` says what a value looks like in each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib.resources import files

from .fuse import fuse
from .graph import REDUCTIONS, Value, reachable
from .program import Output, Program, build
from .schedule import scheduled
from .spec import KernelSpec

CHAIN = 5
INTERLEAVED = 2  # chains whose statements alternate, to keep both arithmetic ports busy
LONG = 700  # lane operations above which chains run in a loop instead of unrolled

TRIGONOMETRY = 12  # operations of half a sine and cosine
NEAR = 1e-14  # margin or quality below which a sample is looked at again by the interpreter

_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/"}


@dataclass
class Table:
    """Values that `prepare` computes: shared ones, then those of each group's lanes."""

    shared: dict[Value, int] = field(default_factory=dict)
    lanes: list[dict[Value, int]] = field(default_factory=list)


@dataclass(frozen=True)
class Source:
    """Generated C and what a caller must know of it.

    outputs:    names and sizes, in the order in which `one` and `batch` write them.
    table_size: numbers that `prepare` computes.
    operations: vector operations of one batch step; a fused multiply-add counts one.
    """

    text: str
    outputs: list[tuple[str, int]]
    table_size: int
    operations: int


def emit(spec: KernelSpec, width: int) -> Source:
    """The kernel's C for `width` lanes."""
    program = fused(build(spec))
    printer = _Printer(program, width)
    outputs: dict[str, int] = {}
    for o in program.outputs:
        outputs[o.name] = outputs.get(o.name, 0) + (spec.n if o.lane else 1)
    names = [name for name, count in outputs.items() for _ in range(count)]
    careful = None if spec.n == spec.m else _Printer(fused(build(spec, careful=True)), width)
    sizes = {
        "W": width,
        "INPUTS": len(program.layout.inputs),
        "OUTPUTS": len(names),
        "MARGIN": names.index("margin"),
        "QUALITY": names.index("quality"),
        "NEAR": NEAR,
    }
    pieces = [
        *(f"#define {name} {value}" for name, value in sizes.items()),
        _text("vector.h"),
        printer.prepare("prepare_quick"),
        printer.one("quick"),
        printer.batch(),
        *(_careful(careful) if careful else ()),
        f"#define QUICK_TABLE {printer.table_size}",
        _text("driver.h"),
    ]
    size = printer.table_size + (careful.table_size if careful else 0)
    return Source("\n".join(pieces), list(outputs.items()), size, printer.operations())


def _careful(printer: _Printer) -> list[str]:
    """One evaluation that keeps its accuracy where the quick one's torques lose it."""
    return ["#define CAREFUL", printer.prepare("prepare_careful"), printer.one("careful")]


def _text(name: str) -> str:
    return (files(__package__) / "c" / name).read_text(encoding="utf-8")


def fused(program: Program) -> Program:
    """The program with its sums as fused multiply-adds."""
    roots = [v for output in program.outputs for v in output.nodes]
    graph, moved = fuse(program.graph, roots, CHAIN)
    renamed = dict(zip(roots, moved, strict=True))
    outputs = [Output(o.name, o.lane, tuple(renamed[v] for v in o.nodes)) for o in program.outputs]
    return Program(program.spec, program.layout, graph, outputs)


def _table(program: Program, order: list[Value]) -> Table:
    """Fixed values that varying ones (or outputs) use."""
    g = program.graph
    table = Table(lanes=[{} for _ in program.spec.chains])
    used = {a for v in order if g.nodes[v].varies for a in g.nodes[v].args}
    used |= {v for o in program.outputs for v in o.nodes}
    for v in order:
        node = g.nodes[v]
        if node.varies or v not in used or node.op == "const":
            continue
        slots = table.shared if node.group is None else table.lanes[node.group]
        slots[v] = len(slots)
    return table


class _Printer:
    def __init__(self, program: Program, width: int) -> None:
        roots = [v for output in program.outputs for v in output.nodes]
        order = reachable(program.graph, roots)
        table = _table(program, order)
        self.program, self.g, self.order, self.table = program, program.graph, order, table
        self.width = width
        self.counts = [count for _, count in program.spec.chains]
        self.padded = [-(-count // width) * width for count in self.counts]
        self.varying = [v for v in order if self.g.nodes[v].varies]
        self.fixed = [v for v in order if not self.g.nodes[v].varies]
        self.starts = []
        start = len(table.shared)
        for lanes, padded in zip(table.lanes, self.padded, strict=True):
            self.starts.append(start)
            start += len(lanes) * padded
        self.table_size = start
        self.lane_operations = sum(1 for v in self.varying if self.g.nodes[v].group is not None)

    @property
    def blocks(self) -> list[int]:
        """Vectors that hold a group's lanes."""
        return [padded // self.width for padded in self.padded]

    def looped(self, copies: list[int]) -> bool:
        """Whether the copies of lane statements run in a loop: unrolled they would be too long."""
        return self.lane_operations > LONG and max(copies) > 1

    def operations(self) -> int:
        """Vector operations of a batch step; a fused multiply-add counts one."""
        total = 0
        for v in self.varying:
            node = self.g.nodes[v]
            copies = 1 if node.group is None else self.counts[node.group]
            if node.op in REDUCTIONS:
                # A product nobody else wants joins the sum by a fused multiply-add.
                groups = [self.g.nodes[t].group for t in node.args]
                total += sum(1 if g is None else self.counts[g] for g in groups)
            elif node.op in ("sin", "cos"):
                total += TRIGONOMETRY
            elif node.op not in ("neg", "input"):
                total += copies
        return total - sum(self._joined(v) for v in self.varying)

    def _joined(self, v: Value) -> int:
        """Products that vanish in the sum over chains that alone wants them."""
        node = self.g.nodes[v]
        if node.op != "mul" or node.group is None:
            return 0
        users = [u for u in self.varying if v in self.g.nodes[u].args]
        alone = len(users) == 1 and self.g.nodes[users[0]].op == "sum"
        return self.counts[node.group] if alone else 0

    # -- what is fixed ---------------------------------------------------------------------

    def prepare(self, name: str) -> str:
        """Fixed values, scalar: shared ones once, lane ones for each chain."""
        head = f"static void {name}(const double *par, const double *const *lane, double *table) {{"
        lines = [head]
        arrays = [v for v in self.fixed if self.g.nodes[v].group is not None]
        for v in arrays:
            lines.append(f"  double x{v}[{self.padded[self.g.nodes[v].group]}];")  # type: ignore[index]
        for v in self.fixed:
            node = self.g.nodes[v]
            if node.group is None:
                lines.append(f"  const double x{v} = {self._fixed(v, '')};")
            else:
                loop = f"  for (int i = 0; i < {self.padded[node.group]}; i++)"
                lines.append(f"{loop} x{v}[i] = {self._fixed(v, '[i]')};")
        for v, slot in self.table.shared.items():
            lines.append(f"  table[{slot}] = x{v};")
        for group, slots in enumerate(self.table.lanes):
            padded = self.padded[group]
            for v, slot in slots.items():
                at = self.starts[group] + slot * padded
                lines.append(f"  for (int i = 0; i < {padded}; i++) table[{at} + i] = x{v}[i];")
        return "\n".join([*lines, "}", ""])

    def _fixed(self, v: Value, index: str) -> str:
        node = self.g.nodes[v]
        if node.op == "parameter":
            return f"par[{node.data[0]}]"
        if node.op == "lane":
            group, k = node.data
            assert isinstance(group, int)
            return f"lane[{group}][{k} * {self.padded[group]} + i]"
        if node.op in REDUCTIONS:
            terms = []
            for t in node.args:
                group = self.g.nodes[t].group
                if group is None:
                    terms.append(f"{sum(self.counts)} * x{t}")
                    continue
                terms += [f"x{t}[{i}]" for i in range(self.counts[group])]
            if node.op == "sum":
                return " + ".join(terms)
            text = terms[0]
            for term in terms[1:]:
                text = f"fmin_s({text}, {term})"
            return text
        return self._operation(v, lambda a: self._fixed_name(a, index), "_s")

    def _fixed_name(self, v: Value, index: str) -> str:
        node = self.g.nodes[v]
        if node.op == "const":
            return _number(node.data[0])
        return f"x{v}{index if node.group is not None else ''}"

    # -- what varies -----------------------------------------------------------------------

    def one(self, name: str) -> str:
        shape = _Shape("double", "_s", self.blocks, lane_table="load({} + {})", stride=self.width)
        head = f"static void {name}(const double *restrict table, const double *restrict in, "
        head += "double *restrict out) {"
        return self._body(shape, head)

    def batch(self) -> str:
        shape = _Shape("vec", "_v", self.counts, lane_table="table[{} + {}]", stride=1)
        head = "INLINE void step(const double *restrict table, const double *const *in, "
        head += "size_t at, vec *restrict out) {"
        return self._body(shape, head)

    def _body(self, shape: _Shape, head: str) -> str:
        self.shape = shape
        phases = range(max(self.g.nodes[v].phase for v in self.varying) + 1)
        lines = [head]
        looped = self.looped(shape.copies)
        self.arrays = self._kept() if looped else set()
        for v in sorted(self.arrays):
            lines.append(f"  vec x{v}_[{shape.copies[self.g.nodes[v].group]}];")  # type: ignore[index]
        if shape.shared == "double" and not looped:
            order = scheduled(self.g, self.varying)
            return "\n".join([*lines, *self._straight(order), *self._outputs(), "}", ""])
        for phase in phases:
            shared = [v for v in self.varying if self._in(v, phase, None)]
            lines += [f"  {s}" for s in self._statements(shared, 0)]
            for group, copies in enumerate(shape.copies):
                lanes = [v for v in self.varying if self._in(v, phase, group)]
                lines += self._lanes(lanes, group, copies, phase, looped)
        return "\n".join([*lines, *self._outputs(), "}", ""])

    def _straight(self, order: list[Value]) -> list[str]:
        """Statements in the given order, the copies of a lane value together."""
        lines, printed = [], set[Value]()
        for v in order:
            node = self.g.nodes[v]
            copies = 1 if node.group is None else self.shape.copies[node.group]
            if v in printed:
                continue
            pair = [v]
            if node.op in ("sin", "cos"):
                partner = self._partner(v, order)
                pair += [] if partner is None else [partner]
            printed.update(pair)
            for c in range(copies):
                lines += [f"  {s}" for s in self._statements(pair, c)]
        return lines

    def _in(self, v: Value, phase: int, group: int | None) -> bool:
        node = self.g.nodes[v]
        return node.phase == phase and node.group == group

    def _lanes(
        self, lanes: list[Value], group: int, copies: int, phase: int, looped: bool
    ) -> list[str]:
        """Statements of a group's lanes: unrolled copy by copy, or in a loop."""
        if not lanes:
            return []
        if not looped:
            lines = []
            for first in range(0, copies, INTERLEAVED):
                some = range(first, min(first + INTERLEAVED, copies))
                lists = [list(self._statements(lanes, c)) for c in some]
                lines += [f"  {s}" for row in zip(*lists, strict=True) for s in row]
            return lines
        sums = [
            (v, t)
            for v in self.varying
            if self.g.nodes[v].op in REDUCTIONS and self.g.nodes[v].phase == phase + 1
            for t in self.g.nodes[v].args
            if self.g.nodes[t].group == group
        ]
        lines = [f"  vec r{v}_{group};" for v, _ in sums]
        lines.append(f"  for (int c = 0; c < {copies}; c++) {{")
        lines += [f"    {s}" for s in self._statements(lanes, -1)]
        for v, t in sums:
            r, x = f"r{v}_{group}", self._name(t, -1)
            add = f"{r} + {x}" if self.g.nodes[v].op == "sum" else f"fmin_v({r}, {x})"
            lines.append(f"    {r} = c ? {add} : {x};")
        lines += [f"    x{v}_[c] = {self._name(v, -1)};" for v in lanes if v in self.arrays]
        return [*lines, "  }"]

    def _kept(self) -> set[Value]:
        """Lane values that a later phase or an output needs."""
        kept = {v for o in self.program.outputs if o.lane for v in o.nodes}
        for v in self.varying:
            node = self.g.nodes[v]
            if node.op not in REDUCTIONS:
                kept |= {a for a in node.args if self.g.nodes[a].phase < node.phase}
        return {v for v in kept if self.g.nodes[v].group is not None and self.g.nodes[v].varies}

    def _statements(self, values: list[Value], copy: int) -> Iterator[str]:
        pairs: set[Value] = set()
        for v in values:
            node = self.g.nodes[v]
            kind = "vec" if node.group is not None else self.shape.shared
            suffix = "_v" if kind == "vec" else "_s"
            if node.op in ("sin", "cos"):
                if v in pairs:
                    continue
                partner = self._partner(v, values)
                pairs.add(partner if partner is not None else v)
                s, c = self._target(v, copy), f"unused{v}_{max(copy, 0)}"
                if partner is not None:
                    c = self._target(partner, copy)
                if node.op == "cos":
                    s, c = c, s
                a = self._name(node.args[0], copy)
                if kind == "vec" and self.g.nodes[node.args[0]].group is None:
                    a = f"({a})"
                yield f"{kind} {s}, {c}; sincos{suffix}({a}, &{s}, &{c});"
            else:
                yield f"const {kind} {self._target(v, copy)} = {self._expression(v, copy, suffix)};"

    def _partner(self, v: Value, values: list[Value]) -> Value | None:
        node = self.g.nodes[v]
        other = "cos" if node.op == "sin" else "sin"
        for w in values:
            if self.g.nodes[w].op == other and self.g.nodes[w].args == node.args:
                return w
        return None

    def _target(self, v: Value, copy: int) -> str:
        return f"x{v}" if self.g.nodes[v].group is None or copy < 0 else f"x{v}_{copy}"

    def _name(self, v: Value, copy: int) -> str:
        node = self.g.nodes[v]
        if node.op == "const":
            return _number(node.data[0])
        if not node.varies:
            if node.group is None:
                return f"table[{self.table.shared[v]}]"
            at = self.starts[node.group] + self.table.lanes[node.group][v] * self.padded[node.group]
            index = "c" if copy < 0 else str(copy)
            if self.shape.stride > 1:
                index = f"{index} * {self.shape.stride}"
                return f"load(table + {at} + {index})"
            return f"table[{at} + {index}]"
        if v in self.arrays and copy < 0 and node.phase < self._phase:
            return f"x{v}_[c]"
        return self._target(v, copy)

    def _expression(self, v: Value, copy: int, suffix: str) -> str:
        node = self.g.nodes[v]
        self._phase = node.phase
        if node.op == "input":
            i = node.data[0]
            return f"in[{i}]" if self.shape.shared == "double" else f"load(in[{i}] + at)"
        if node.op in REDUCTIONS:
            return self._reduction(v)
        return self._operation(v, lambda a: self._name(a, copy), suffix)

    def _operation(self, v: Value, name, suffix: str) -> str:
        node = self.g.nodes[v]
        if node.op in _INFIX:
            a, b = (name(x) for x in node.args)
            if node.op == "div" and a == "1.0" and self._is_sqrt(node.args[1]):
                root = self.g.nodes[node.args[1]]
                return f"rsqrt{suffix}({name(root.args[0])})"
            return f"{a} {_INFIX[node.op]} {b}"
        if node.op in ("fma", "fnma"):
            a, b, c = (name(x) for x in node.args)
            return f"{c} {'+' if node.op == 'fma' else '-'} {a} * {b}"
        if node.op == "neg":
            return f"-{name(node.args[0])}"
        if node.op == "const":
            return _number(node.data[0])
        args = [name(a) for a in node.args]
        if suffix == "_v":
            # Functions take vectors; a shared operand has to be spread.
            args = [
                f"spread({text})" if self._is_scalar(a) else text
                for a, text in zip(node.args, args, strict=True)
            ]
        if node.op in ("sin", "cos"):
            return f"{node.op}({args[0]})"
        return f"{node.op}{suffix}({', '.join(args)})"

    def _is_sqrt(self, v: Value) -> bool:
        return self.g.nodes[v].op == "sqrt" and self.g.nodes[v].varies

    def _is_scalar(self, v: Value) -> bool:
        """Whether a value is a plain double where a vector is being computed."""
        node = self.g.nodes[v]
        if node.op == "const":
            return True
        if not node.varies:
            return node.group is None or self.shape.stride == 1
        return node.group is None and self.shape.shared == "double"

    def _reduction(self, v: Value) -> str:
        node = self.g.nodes[v]
        terms = []
        for t in node.args:
            group = self.g.nodes[t].group
            if group is None:
                times = sum(self.shape.copies)
                terms.append(
                    f"({times} * {self._name(t, 0)})" if node.op == "sum" else self._name(t, 0)
                )
            elif self.looped(self.shape.copies):
                terms.append(f"r{v}_{group}")
            else:
                terms += [self._name(t, c) for c in range(self.shape.copies[group])]
        if node.op == "sum":
            text = " + ".join(terms)
            return f"lanes_sum({text})" if self.shape.shared == "double" else text
        text = terms[0]
        for term in terms[1:]:
            text = f"fmin_v({text}, {term})"
        return f"lanes_least({text})" if self.shape.shared == "double" else text

    def _outputs(self) -> Iterator[str]:
        slot = 0
        looped = bool(self.arrays)
        for o in self.program.outputs:
            if not o.lane:
                name = self._name(o.nodes[0], 0)
                if self.shape.shared == "vec" and self._is_scalar(o.nodes[0]):
                    name = f"spread({name})"
                yield f"  out[{slot}] = {name};"
                slot += 1
                continue
            for group, v in enumerate(o.nodes):
                for c in range(self.shape.copies[group]):
                    name = f"x{v}_[{c}]" if looped else self._name(v, c)
                    if self.shape.shared == "vec":
                        if self._is_scalar(v):
                            name = f"spread({name})"
                        yield f"  out[{slot + c}] = {name};"
                        continue
                    used = min(self.width, self.counts[group] - c * self.width)
                    yield f"  {{ vec t = {name}; "
                    if used == self.width:
                        yield f"    store(out + {slot + c * self.width}, t); }}"
                    else:
                        at = slot + c * self.width
                        copies = " ".join(f"out[{at + i}] = t[{i}];" for i in range(used))
                        yield f"    {copies} }}"
                slot += self.counts[group]


@dataclass(frozen=True)
class _Shape:
    """How a shape prints values.

    shared: type of shared values.  copies: of each group's statements.  stride: lanes a copy.
    """

    shared: str
    suffix: str
    copies: list[int]
    lane_table: str
    stride: int


def _number(value: object) -> str:
    assert isinstance(value, float)
    text = repr(value)
    return f"({text})" if value < 0 else text
