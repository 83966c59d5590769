"""Graphs from graphs: derivatives against differences and by hand, and values in others' places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from backends.test_operations import ARITY, columns
from support.programs import LANES

from condyle.backends.numpy_kernel import NumpyKernel
from condyle.graph.graph import Graph, Value, reachable
from condyle.graph.operations import OPERATIONS
from condyle.graph.program import Numbers, Output, Port, Program, Programs
from condyle.graph.transform import adjoints, jacobian, substituted, tangents

JUMPS = ("le", "lt", "eq", "ne", "and", "or", "not", "sign", "floor", "ceil")
# The callers' order of lanes is another than the program's.
NUMBERS = Numbers(np.zeros((1, 1)), (np.zeros((1, 1, LANES)),), (np.zeros((1, 1)),), (2, 0, 1))


def run(
    graph: Graph, roots: Sequence[Value], x: np.ndarray, y: np.ndarray | None = None
) -> list[np.ndarray]:
    """Values of roots, (N,) or (LANES, N): x (N, k) of samples, y (N, l, LANES) of lanes."""
    k = x.shape[1]
    ports, given, width = [Port("x", k, "", False, 0)], {"x": x}, k
    if y is not None:
        ports.append(Port("y", y.shape[1], "", True, k))
        given["y"], width = y if y.shape[1] > 1 else y[:, 0], k + LANES * y.shape[1]
    lanes = [graph.nodes[v].group is not None for v in roots]
    outputs = [Output(str(i), (), "", lanes[i], ((v,),)) for i, v in enumerate(roots)]
    p = Program(graph, (LANES,), width, tuple(ports), tuple(outputs), ())
    return [*NumpyKernel(Programs(p), NUMBERS).run(given).values.values()]


def inputs(graph: Graph, shared: int, lanes: int = 0) -> list[Value]:
    own = [graph.leaf("lane_input", 0, shared + LANES * i, group=0) for i in range(lanes)]
    return [graph.leaf("input", i) for i in range(shared)] + own


@pytest.mark.parametrize("name", OPERATIONS)
def test_partials_are_slopes(name: str) -> None:
    """Along each argument alone, away from jumps."""
    rng, h = np.random.default_rng(1), 1e-6
    x = columns(name, rng, 60)
    x += rng.uniform(0.01, 0.04, x.shape) * (np.abs(x) < 2.9)  # off special points
    if name in ("asin", "acos", "atanh"):
        x = np.clip(x, -0.9, 0.9)
    graph = Graph()
    leaves = inputs(graph, ARITY[name])
    value = graph.apply(name, *leaves)
    zero = dict.fromkeys(leaves, graph.const(0.0))
    for leaf, step in zip(leaves, h * np.eye(len(leaves)), strict=True):
        (slope,) = tangents(graph, [value], zero | {leaf: graph.const(1.0)})
        (got,) = run(graph, [slope], x)
        (right,), (left,) = (run(graph, [value], x + s * step) for s in (1, -1))
        wanted = (right - left) / (2 * h)
        smooth = np.abs(wanted) < 1e4  # no jump between the two
        assert smooth.sum() > 40
        np.testing.assert_allclose(got[smooth], wanted[smooth], rtol=1e-6, atol=2e-8)
        if name in JUMPS:
            assert not got.any()


def test_tangents_go_through_sums_over_lanes() -> None:
    """sum_i sin(x y_i) z_i + x^2, along directions of samples and lanes."""
    graph, rng, h = Graph(), np.random.default_rng(2), 1e-5
    x, w, y, z = inputs(graph, 2, 2)
    term = graph.apply("mul", graph.apply("sin", graph.apply("mul", x, y)), z)
    inner = graph.reduce("sum", [term])
    outer = graph.reduce("sum", [graph.apply("mul", inner, graph.apply("add", y, w))])
    root = graph.apply("add", outer, graph.apply("mul", x, x))
    direction = np.array([0.7, -0.2, 1.3, 0.4])
    seeds = {v: graph.const(d) for v, d in zip((x, w, y, z), direction, strict=True)}
    (slope,) = tangents(graph, [root], seeds)
    given, lanes = rng.normal(0, 1, (20, 2)), rng.normal(0, 1, (20, 2, LANES))
    (right,), (left,) = (
        run(graph, [root], given + s * direction[:2], lanes + s * direction[2:, None])
        for s in (h, -h)
    )
    found, value = run(graph, [slope, root], given, lanes)
    np.testing.assert_allclose(found, (right - left) / (2 * h), rtol=1e-8, atol=1e-8)
    a, b = given.T[:, :, None]
    total = (np.sin(a * lanes[:, 0]) * lanes[:, 1]).sum(axis=1)
    by_hand = total * (lanes[:, 0] + b).sum(axis=1) + given[:, 0] ** 2
    np.testing.assert_allclose(value, by_hand, rtol=1e-12)


def test_a_waist_shortens_derivatives_and_leaves_them_as_they_are() -> None:
    """sum_i exp(s_i) sin(s_i) + s_i x_0 by four leaves that meet in s_i = sum x_k y_i^k."""
    graph, rng = Graph(), np.random.default_rng(6)
    *x, y = inputs(graph, 4, 1)
    s, power = x[0], y
    for leaf in x[1:]:
        s = graph.apply("add", s, graph.apply("mul", leaf, power))
        power = graph.apply("mul", power, y)
    wave = graph.apply("mul", graph.apply("exp", s), graph.apply("sin", s))
    root = graph.reduce("sum", [graph.apply("add", wave, graph.apply("mul", s, x[0]))])
    plain = [by[root] for by in jacobian(graph, [root], x)]
    graph.waists.append((s,))
    short = [by[root] for by in jacobian(graph, [root], x)]
    assert len(reachable(graph, short)) < len(reachable(graph, plain))
    a, lanes = rng.normal(0, 1, (9, 4)), rng.normal(0, 1, (9, 1, LANES))
    found = run(graph, [*plain, *short], a, lanes)
    at = (a[:, :, None] * lanes ** np.arange(4)[:, None]).sum(axis=1)
    slope = np.exp(at) * (np.sin(at) + np.cos(at)) + a[:, :1]
    wanted = [(slope * lanes[:, 0] ** i).sum(axis=1) for i in range(4)]
    wanted[0] += at.sum(axis=1)
    np.testing.assert_allclose(found, [*wanted, *wanted], rtol=1e-11)


def test_adjoints_sum_over_lanes_what_these_hand_to_shared_values() -> None:
    """Of a sum of a shared root and of lanes of another, by samples, lanes and a shared term."""
    graph, rng = Graph(), np.random.default_rng(4)
    x, w, y, z, held = inputs(graph, 2, 3)
    swing = graph.apply("sin", graph.apply("mul", x, y))
    inner = graph.reduce("sum", [graph.apply("mul", swing, z)])
    alike = graph.reduce("sum", [graph.apply("mul", x, w)])  # the same in every lane
    shared = graph.apply("mul", inner, graph.apply("add", alike, x))
    own = graph.apply("add", graph.apply("mul", w, w), graph.apply("mul", inner, y))
    by = adjoints(graph, [shared, own], [w, graph.const(3.0)], [x, w, y, z], (LANES,))
    assert [graph.nodes[v].group for v in by] == [None, None, 0, 0]
    # A cotangent is held, in every lane: the root is w' shared + 3 own, with w' = w.
    root = graph.apply(
        "add", graph.apply("mul", held, shared), graph.apply("mul", graph.const(3.0 * LANES), own)
    )
    given, lanes = rng.normal(0, 1, (20, 2)), rng.normal(0, 1, (20, 3, LANES))
    lanes[:, 2] = given[:, 1:]

    def slope(place: int, *at: int) -> np.ndarray:
        ends = []
        for sign in (1, -1):
            moved = [given.copy(), lanes.copy()]
            moved[place][(slice(None), *at)] += sign * 1e-5
            ends.append(run(graph, [root], *moved)[0].sum(axis=0) / LANES)
        return (ends[0] - ends[1]) / 2e-5

    wanted = [slope(0, i) for i in range(2)]
    wanted += [np.array([slope(1, i, lane) for lane in range(LANES)]) for i in range(2)]
    for found, right in zip(run(graph, by, given, lanes), wanted, strict=True):
        np.testing.assert_allclose(found, right, rtol=1e-7, atol=1e-7)


def test_what_has_no_derivative() -> None:
    """What does not depend has none, and a minimum over lanes is refused."""
    graph = Graph()
    a, b, y = inputs(graph, 2, 1)
    zero, one = graph.const(0.0), graph.const(1.0)
    root = graph.apply("mul", graph.apply("sqrt", b), b)
    assert tangents(graph, [root, a], {a: one, b: zero}) == [zero, one]
    least = graph.reduce("least", [y])
    with pytest.raises(AssertionError, match="minimum over lanes"):
        tangents(graph, [least], {y: one})
    with pytest.raises(AssertionError, match="minimum over lanes"):
        adjoints(graph, [least], [one], [y], (LANES,))


def test_substituted_puts_values_in_the_place_of_others() -> None:
    """The old roots stay as they are; what vanishes takes its products along, also in sums."""
    graph = Graph()
    a, b, c, y = inputs(graph, 3, 1)
    inner = graph.apply("mul", a, b)
    root = graph.apply("add", graph.apply("sin", inner), a)
    (new,) = substituted(graph, [root], {b: c})
    (other,) = substituted(graph, [root], {inner: c})
    x = np.random.default_rng(3).normal(0, 1, (9, 3))
    inside = x[:, 0] * x[:, 1], x[:, 0] * x[:, 2], x[:, 2]
    wanted = [np.sin(angle) + x[:, 0] for angle in inside]
    np.testing.assert_allclose(run(graph, [root, new, other], x), wanted, rtol=1e-14)
    assert substituted(graph, [root], {c: a}) == [root]
    total = graph.reduce("sum", [graph.apply("mul", y, a)])
    (left,) = substituted(graph, [graph.apply("add", total, b)], {a: graph.const(0.0)})
    operations = {graph.nodes[v].op for v in reachable(graph, [left])}
    assert "mul" not in operations and "lane_input" not in operations
