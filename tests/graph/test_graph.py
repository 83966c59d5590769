"""The pieces that turn expressions into statements, each alone, in exact arithmetic.

Simplifying and fusing must not change a value at all, so values are fractions here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from random import Random

import casadi as ca
import pytest

from condyle.backends.c.emit import CHAIN
from condyle.errors import UnsupportedError
from condyle.graph.fuse import fuse
from condyle.graph.graph import Graph, Value, reachable
from condyle.graph.operations import BY_CASADI
from condyle.graph.read import read
from condyle.graph.schedule import scheduled

EXACT: dict[str, Callable[..., Fraction]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "fmin": min,
    "fmax": max,
}
COMPUTED: dict[str, Callable[..., float]] = EXACT | {
    "fma": lambda a, b, c: c + a * b,
    "fnma": lambda a, b, c: c - a * b,
    "fabs": abs,
    "le": lambda a, b: float(a <= b),
    "lt": lambda a, b: float(a < b),
    **{name: getattr(math, name) for name in ("sqrt", "sin", "cos", "atan2")},
}
LANES = 3


def evaluate(graph: Graph, roots: Sequence[Value], leaf: Callable[..., list]) -> list[list]:
    """Values of the roots in each of `LANES` lanes; `leaf` returns those of a leaf."""
    values: dict[Value, list] = {}
    for v in reachable(graph, roots):
        node = graph.nodes[v]
        if node.op == "const":
            values[v] = [Fraction(node.data[0])] * LANES
        elif not node.args:
            values[v] = leaf(node)
        elif node.op == "sum":
            assert all(graph.nodes[a].group is not None for a in node.args)
            values[v] = [sum(x for a in node.args for x in values[a])] * LANES
        else:
            rows = zip(*(values[a] for a in node.args), strict=True)
            values[v] = [COMPUTED[node.op](*row) for row in rows]
    return [values[root] for root in roots]


class Forest:
    """Random expressions, with the value that each ought to have."""

    def __init__(self, seed: int, size: int, lanes: bool = False) -> None:
        self.random, self.graph = Random(seed), Graph()
        self.values: list[tuple[Value, list[Fraction], bool]] = []
        self.leaves: dict[tuple, list[Fraction]] = {}
        for i in range(4):
            self._leaf(self.graph.leaf("input", i), ("input", i), lane=False)
            if lanes:
                self._leaf(self.graph.leaf("lane", 0, i, group=0), ("lane", 0, i), lane=True)
        for x in (0.0, 1.0, -1.0, 2.0, -0.5):
            self.values.append((self.graph.const(x), [Fraction(x)] * LANES, False))
        for _ in range(size):
            self._grow()

    @property
    def roots(self) -> list[Value]:
        return [v for v, _, _ in self.values]

    def _leaf(self, node: Value, name: tuple, lane: bool) -> None:
        numbers = [Fraction(self.random.randint(-9, 9), 7) for _ in range(LANES)]
        self.leaves[name] = numbers if lane else numbers[:1] * LANES
        self.values.append((node, self.leaves[name], lane))

    def leaf(self, node) -> list[Fraction]:
        return self.leaves[(node.op, *node.data)]

    def _grow(self) -> None:
        """One more operation on what there is, or a sum over the lanes."""
        op = self.random.choice([*EXACT])
        if self.random.random() < 0.1:
            v, x, lane = self.random.choice(self.values)
            if lane and self.graph.nodes[v].group is not None:  # not simplified to a constant
                total = [sum(x, Fraction(0))] * LANES
                self.values.append((self.graph.reduce("sum", [v]), total, False))
            return
        picked = [self.random.choice(self.values[-14:]) for _ in range(1 if op == "neg" else 2)]
        if op == "div" and 0 in picked[1][1]:
            return
        wanted = [EXACT[op](*row) for row in zip(*(x for _, x, _ in picked), strict=True)]
        if max(abs(x.numerator) + x.denominator for x in wanted) > 10**40:
            return
        value = self.graph.apply(op, *(v for v, _, _ in picked))
        self.values.append((value, wanted, any(lane for _, _, lane in picked)))


def operations(graph: Graph, roots: Sequence[Value]) -> list[str]:
    return sorted(graph.nodes[v].op for v in reachable(graph, roots) if graph.nodes[v].args)


def test_simplifying_changes_no_value() -> None:
    for seed in range(100):
        forest = Forest(seed, 60)
        got = evaluate(forest.graph, forest.roots, forest.leaf)
        assert got == [x for _, x, _ in forest.values], seed


@pytest.mark.parametrize("chain", [2, CHAIN])
def test_fusing_changes_no_value(chain: int) -> None:
    for seed in range(60):
        forest = Forest(seed, 80, lanes=True)
        picked = forest.random.sample(forest.values, 6)
        new, moved = fuse(forest.graph, [v for v, _, _ in picked], chain)
        assert evaluate(new, moved, forest.leaf) == [x for _, x, _ in picked], seed
        for (old, _, _), value in zip(picked, moved, strict=True):
            assert new.nodes[value].group == forest.graph.nodes[old].group


def test_products_join_sums_unless_they_are_shared() -> None:
    """a b + c d - e f + g is three fused multiply-adds; what two sums want is computed once."""
    graph = Graph()
    a, b, c, d, e, f, g = (graph.leaf("input", i) for i in range(7))
    ab, cd, ef = (graph.apply("mul", *pair) for pair in ((a, b), (c, d), (e, f)))
    root = graph.apply("add", graph.apply("sub", graph.apply("add", ab, cd), ef), g)
    assert operations(*fuse(graph, [root], CHAIN)) == ["fma", "fma", "fnma"]
    sums = [graph.apply("add", ab, x) for x in (c, d)]
    assert operations(*fuse(graph, sums, CHAIN)) == ["add", "add", "mul"]


def test_equal_operations_are_one_node() -> None:
    graph = Graph()
    a, b = graph.leaf("input", 0), graph.leaf("input", 1)
    assert graph.apply("add", a, b) == graph.apply("add", b, a)
    assert graph.apply("sub", a, b) != graph.apply("sub", b, a)
    assert graph.apply("neg", graph.apply("sub", a, b)) == graph.apply("sub", b, a)
    assert graph.apply("mul", a, graph.const(-1.0)) == graph.apply("neg", a)
    assert graph.leaf("lane", 0, 1, group=0) != graph.leaf("lane", 1, 1, group=1)


def test_arc_functions_vanish() -> None:
    graph = Graph()
    y, x = graph.leaf("input", 0), graph.leaf("input", 1)
    angle = graph.apply("atan2", y, x)
    roots = [graph.apply(op, angle) for op in ("sin", "cos")]
    assert not {"atan2", "sin", "cos"} & {*operations(graph, roots)}
    for numbers in ((0.3, -2.0), (-1.0, 0.0), (1e-9, -1.0)):
        got = evaluate(graph, roots, lambda node, n=numbers: [n[node.data[0]]] * LANES)
        unit = [x / math.hypot(*numbers) for x in numbers]
        assert [row[0] for row in got] == pytest.approx(unit, rel=1e-15)


def test_reading_casadi(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every operation that formulas use, entry by entry; what has no code says so."""
    x = [ca.SX.sym(f"x{i}") for i in range(3)]
    a, b, c = x
    expressions = [
        ca.vertcat(a + b, a - b, a * b, a / b, -a, 2 * c, c * c, 1 / c),
        ca.vertcat(ca.sqrt(c), ca.sin(a), ca.cos(a), ca.fabs(b), ca.atan2(a, b)),
        ca.vertcat(ca.fmin(a, b), ca.fmax(a, b), a**3, b**4, a <= b, a < b, b <= a),
        ca.vertcat(ca.norm_2(ca.vertcat(a, b, c)), 0, 1, a),
    ]
    graph = Graph()
    known = {symbol.name(): graph.leaf("input", i) for i, symbol in enumerate(x)}
    entries = read(graph, expressions, known)
    function = ca.Function("f", x, expressions)
    for point in ((0.7, -1.3, 2.1), (-2.0, 0.25, 0.5), (1.0, 1.0, 1.0)):
        for part, right in zip(entries, function(*map(ca.DM, point)), strict=True):
            got = evaluate(graph, part, lambda n, p=point: [p[n.data[0]]] * LANES)
            wanted = [float(v) for v in ca.vertsplit(right)]
            assert [float(row[0]) for row in got] == pytest.approx(wanted, rel=1e-14, abs=1e-15)
    monkeypatch.delitem(BY_CASADI, ca.OP_ERF)
    with pytest.raises(UnsupportedError, match="is not in the table"):
        read(graph, [ca.erf(a)], known)


def test_schedule_keeps_arguments_first() -> None:
    for seed in range(40):
        forest = Forest(seed, 120)
        nodes = forest.graph.nodes
        values = [v for v in reachable(forest.graph, forest.roots) if nodes[v].varies]
        order = scheduled(forest.graph, values)
        assert sorted(order) == sorted(values)
        place = {v: i for i, v in enumerate(order)}
        assert all(place[a] < place[v] for v in order for a in nodes[v].args if a in place)


def test_schedule_starts_the_longest_way_first() -> None:
    graph = Graph()
    a, b = graph.leaf("input", 0), graph.leaf("input", 1)
    quick = graph.apply("add", a, b)
    first = graph.apply("sqrt", a)
    end = graph.apply("mul", graph.apply("sqrt", first), quick)
    order = scheduled(graph, reachable(graph, [quick, first, end]))
    assert order.index(a) < order.index(b)
    assert order.index(first) < order.index(quick) < order.index(end)
