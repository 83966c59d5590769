"""Graphs from graphs: derivatives against differences and by hand, and values in others' places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from backends.test_operations import ARITY, columns
from support.programs import LANES, no_numbers, program

from condyle.backends.numpy_kernel import NumpyKernel
from condyle.graph.graph import Graph, Value, reachable
from condyle.graph.operations import OPERATIONS
from condyle.graph.program import Numbers, Output, Port, Program, Variants
from condyle.graph.transform import adjoints, jacobian, substituted, tangents

STEP = 1e-6
JUMPS = ("le", "lt", "eq", "ne", "and", "or", "not", "sign", "floor", "ceil")


def values(graph: Graph, roots: Sequence[Value], samples: np.ndarray) -> np.ndarray:
    """(roots, N) at samples (N, columns) of shared inputs."""
    p = program(graph, roots, samples.shape[1])
    found = NumpyKernel(Variants(p), no_numbers()).run({"x": samples}).values
    return np.array([found[str(i)] for i in range(len(roots))])


@pytest.mark.parametrize("name", OPERATIONS)
def test_partials_are_slopes(name: str) -> None:
    """Along each argument alone, away from jumps."""
    rng = np.random.default_rng(1)
    x = columns(name, rng, 60)
    x += rng.uniform(0.01, 0.04, x.shape) * (np.abs(x) < 2.9)  # off special points
    if name in ("asin", "acos", "atanh"):
        x = np.clip(x, -0.9, 0.9)
    graph = Graph()
    leaves = [graph.leaf("input", i) for i in range(ARITY[name])]
    value = graph.apply(name, *leaves)
    for i, leaf in enumerate(leaves):
        zero = dict.fromkeys(leaves, graph.const(0.0))
        (slope,) = tangents(graph, [value], zero | {leaf: graph.const(1.0)})
        step = STEP * np.eye(len(leaves))[i]
        (got,) = values(graph, [slope], x)
        (right,), (left,) = (values(graph, [value], x + s * step) for s in (1, -1))
        wanted = (right - left) / (2 * STEP)
        smooth = np.abs(wanted) < 1e4  # no jump between the two
        assert smooth.sum() > 40
        np.testing.assert_allclose(got[smooth], wanted[smooth], rtol=1e-6, atol=2e-8)
        if name in JUMPS:
            assert not got.any()


def lanes_program(graph: Graph, roots: Sequence[Value]) -> Program:
    """Shared roots of 2 numbers a sample and 2 a lane."""
    ports = (Port("x", 2, "", False, 0), Port("y", 2, "", True, 2))
    outputs = tuple(Output(str(i), (), "", False, ((v,),)) for i, v in enumerate(roots))
    return Program(graph, (LANES,), 2 + 2 * LANES, ports, outputs, ())


def test_tangents_go_through_sums_over_lanes() -> None:
    """sum_i sin(x y_i) z_i + x^2, along directions of samples and lanes."""
    graph, rng = Graph(), np.random.default_rng(2)
    x, w = graph.leaf("input", 0), graph.leaf("input", 1)
    y, z = (graph.leaf("lane_input", 0, 2 + LANES * i, group=0) for i in range(2))
    term = graph.apply("mul", graph.apply("sin", graph.apply("mul", x, y)), z)
    inner = graph.reduce("sum", [term])
    outer = graph.reduce("sum", [graph.apply("mul", inner, graph.apply("add", y, w))])
    root = graph.apply("add", outer, graph.apply("mul", x, x))
    direction = [0.7, -0.2, 1.3, 0.4]
    seeds = {v: graph.const(d) for v, d in zip((x, w, y, z), direction, strict=True)}
    (slope,) = tangents(graph, [root], seeds)
    numbers = Numbers(np.zeros(1), (np.zeros((1, LANES)),), (np.zeros(1),), (2, 0, 1))

    def run(roots: list[Value], shift: float) -> np.ndarray:
        shared = given + shift * np.array(direction[:2])
        lanes = per_lane + shift * np.array(direction[2:])[:, None]
        kernel = NumpyKernel(Variants(lanes_program(graph, roots)), numbers)
        return kernel.run({"x": shared, "y": lanes}).values["0"]

    given, per_lane = rng.normal(0, 1, (20, 2)), rng.normal(0, 1, (20, 2, LANES))
    h = 1e-5
    wanted = (run([root], h) - run([root], -h)) / (2 * h)
    np.testing.assert_allclose(run([slope], 0.0), wanted, rtol=1e-8, atol=1e-8)
    a, b = given.T[:, :, None]
    total = (np.sin(a * per_lane[:, 0]) * per_lane[:, 1]).sum(axis=1)
    by_hand = total * (per_lane[:, 0] + b).sum(axis=1) + given[:, 0] ** 2
    np.testing.assert_allclose(run([root], 0.0), by_hand, rtol=1e-12)


def test_a_waist_shortens_derivatives_and_leaves_them_as_they_are() -> None:
    """sum_i exp(s_i) sin(s_i) + s_i x_0 by four leaves that meet in s_i = sum x_k y_i^k."""
    graph = Graph()
    x = [graph.leaf("input", i) for i in range(4)]
    y = graph.leaf("lane_input", 0, 4, group=0)
    s, power = x[0], y
    for leaf in x[1:]:
        s = graph.apply("add", s, graph.apply("mul", leaf, power))
        power = graph.apply("mul", power, y)
    wave = graph.apply("mul", graph.apply("exp", s), graph.apply("sin", s))
    term = graph.apply("add", wave, graph.apply("mul", s, x[0]))
    root = graph.reduce("sum", [term])
    plain = [by[root] for by in jacobian(graph, [root], x)]
    graph.waists.append((s,))
    short = [by[root] for by in jacobian(graph, [root], x)]
    assert len(reachable(graph, short)) < len(reachable(graph, plain))
    outputs = tuple(Output(str(i), (), "", False, ((v,),)) for i, v in enumerate([*plain, *short]))
    ports = (Port("x", 4, "", False, 0), Port("y", 1, "", True, 4))
    p = Program(graph, (LANES,), 4 + LANES, ports, outputs, ())
    rng = np.random.default_rng(6)
    given = {"x": rng.normal(0, 1, (9, 4)), "y": rng.normal(0, 1, (9, LANES))}
    found = NumpyKernel(Variants(p), no_numbers()).run(given).values
    a, b = given["x"], given["y"][:, None]
    at = (a[:, :, None] * b ** np.arange(4)[:, None]).sum(axis=1)
    slope = np.exp(at) * (np.sin(at) + np.cos(at)) + a[:, :1]
    for i in range(4):
        wanted = (slope * b[:, 0] ** i).sum(axis=1) + (at.sum(axis=1) if i == 0 else 0.0)
        np.testing.assert_allclose(found[str(i)], wanted, rtol=1e-11)
        np.testing.assert_allclose(found[str(i + 4)], wanted, rtol=1e-11)


def test_adjoints_sum_over_lanes_what_these_hand_to_shared_values() -> None:
    """Of a sum of a shared root and of lanes of another, by samples, lanes and a shared term."""
    graph, rng = Graph(), np.random.default_rng(4)
    x, w = graph.leaf("input", 0), graph.leaf("input", 1)
    y, z = (graph.leaf("lane_input", 0, 2 + LANES * i, group=0) for i in range(2))
    swing = graph.apply("sin", graph.apply("mul", x, y))
    inner = graph.reduce("sum", [graph.apply("mul", swing, z)])
    alike = graph.reduce("sum", [graph.apply("mul", x, w)])  # the same in every lane
    shared = graph.apply("mul", inner, graph.apply("add", alike, x))
    own = graph.apply("add", graph.apply("mul", w, w), graph.apply("mul", inner, y))
    leaves = [x, w, y, z]
    by = adjoints(graph, [shared, own], [w, graph.const(3.0)], leaves, (LANES,))
    assert [graph.nodes[v].group for v in by] == [None, None, 0, 0]
    # A cotangent is held: the root is w' shared + 3 own, with w' = w.
    held = graph.leaf("lane_input", 0, 2 + 2 * LANES, group=0)  # in every lane
    root = graph.apply(
        "add", graph.apply("mul", held, shared), graph.apply("mul", graph.const(3.0 * LANES), own)
    )
    numbers = Numbers(np.zeros(1), (np.zeros((1, LANES)),), (np.zeros(1),), (2, 0, 1))
    given, per_lane = rng.normal(0, 1, (20, 2)), rng.normal(0, 1, (20, 3, LANES))
    per_lane[:, 2] = given[:, 1:]

    def run(value: Value, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        ports = (Port("x", 2, "", False, 0), Port("y", 3, "", True, 2))
        lanes = graph.nodes[value].group is not None
        outputs = (Output("0", (), "", lanes, ((value,),)),)
        p = Program(graph, (LANES,), 2 + 3 * LANES, ports, outputs, ())
        return NumpyKernel(Variants(p), numbers).run({"x": a, "y": b}).values["0"]

    def slope(place: str, *at: int) -> np.ndarray:
        found = []
        for sign in (1, -1):
            a, b = given.copy(), per_lane.copy()
            (a if place == "x" else b)[(slice(None), *at)] += sign * 1e-5
            found.append(run(root, a, b).sum(axis=0) / LANES)
        return (found[0] - found[1]) / 2e-5

    for i, v in enumerate(by[:2]):
        np.testing.assert_allclose(run(v, given, per_lane), slope("x", i), rtol=1e-7, atol=1e-7)
    for i, v in enumerate(by[2:]):
        lanes = [slope("y", i, lane) for lane in range(LANES)]
        np.testing.assert_allclose(run(v, given, per_lane), lanes, rtol=1e-7, atol=1e-7)


def test_what_does_not_depend_has_no_derivative() -> None:
    graph = Graph()
    a, b = graph.leaf("input", 0), graph.leaf("input", 1)
    zero = graph.const(0.0)
    one = graph.const(1.0)
    root = graph.apply("mul", graph.apply("sqrt", b), b)
    assert tangents(graph, [root, a], {a: one, b: zero}) == [zero, one]


def test_a_minimum_over_lanes_is_refused() -> None:
    graph = Graph()
    y = graph.leaf("lane_input", 0, 0, group=0)
    least = graph.reduce("least", [y])
    with pytest.raises(AssertionError, match="minimum over lanes"):
        tangents(graph, [least], {y: graph.const(1.0)})
    with pytest.raises(AssertionError, match="minimum over lanes"):
        adjoints(graph, [least], [graph.const(1.0)], [y], (LANES,))


def test_substituted_puts_values_in_the_place_of_others() -> None:
    """Also inside sums over lanes; the old roots stay as they are."""
    graph = Graph()
    a, b, c = (graph.leaf("input", i) for i in range(3))
    inner = graph.apply("mul", a, b)
    root = graph.apply("add", graph.apply("sin", inner), a)
    (new,) = substituted(graph, [root], {b: c})
    x = np.random.default_rng(3).normal(0, 1, (9, 3))
    old, swapped = values(graph, [root, new], x)
    np.testing.assert_allclose(old, np.sin(x[:, 0] * x[:, 1]) + x[:, 0], rtol=1e-14)
    np.testing.assert_allclose(swapped, np.sin(x[:, 0] * x[:, 2]) + x[:, 0], rtol=1e-14)
    (whole,) = substituted(graph, [root], {inner: c})
    np.testing.assert_allclose(values(graph, [whole], x)[0], np.sin(x[:, 2]) + x[:, 0], rtol=1e-14)
    assert substituted(graph, [root], {c: a}) == [root]


def test_what_vanishes_takes_its_products_along() -> None:
    graph = Graph()
    a, b = graph.leaf("input", 0), graph.leaf("input", 1)
    y = graph.leaf("lane_input", 0, 2, group=0)
    total = graph.reduce("sum", [graph.apply("mul", y, a)])
    root = graph.apply("add", total, b)
    (left,) = substituted(graph, [root], {a: graph.const(0.0)})
    operations = {graph.nodes[v].op for v in reachable(graph, [left])}
    assert "mul" not in operations and "lane_input" not in operations
