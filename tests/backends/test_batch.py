"""Batches: every size and stride, reductions, long chains, strange lanes, the C library."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from support.cases import error, ones
from support.programs import LANES, no_numbers, program

from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.backends.c.emit import fused
from condyle.backends.c.loops import LONG, Loops
from condyle.backends.kernel import columns_of
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.graph.graph import Graph
from condyle.graph.operations import REDUCTIONS
from condyle.graph.program import Numbers, Output, Port, Program, Programs

CALLED = (
    *("exp", "expm1", "log", "log1p", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("asinh", "atanh", "erf", "floor", "ceil", "sign", "pow", "hypot", "fmod", "remainder"),
)
WAITING = 40  # values that wait while the C library is asked: more than there are registers
STRANGE = (1e7, -1e7, 1.7e308, math.inf, -math.inf, math.nan, -0.0)

pytestmark = pytest.mark.usefixtures("compiler_command")


def functions() -> Program:
    """sin x, cos x, atan2(x, y), then what the C library is asked for, while values wait."""
    graph = Graph()
    apply = graph.apply
    x, y = graph.leaf("input", 0), graph.leaf("input", 1)
    found = {"sin": apply("sin", x), "cos": apply("cos", x), "atan2": apply("atan2", x, y)}
    waiting = [apply("add", apply("mul", x, graph.const(2.0 + k)), y) for k in range(WAITING)]
    total = graph.const(1.0)
    for v in waiting:
        total = apply("add", total, apply("mul", v, v))
    late = apply("fmin", x, total)  # x, but not before all that waits
    found |= {name: apply(name, late, *[y] * (name in CALLED[-4:])) for name in CALLED}
    found["le"] = apply("le", found["floor"], graph.const(0.0))
    for k, v in enumerate(waiting):
        total = apply("add", total, apply("mul", v, found[CALLED[k % len(CALLED)]]))
    found["total"] = total
    outputs = tuple(Output(name, (), "", False, ((v,),)) for name, v in found.items())
    return replace(program(graph, list(found.values()), 2), outputs=outputs)


FUNCTIONS = Programs(functions(), single=True)


@pytest.fixture(params=(2, 4, 8))
def width(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setenv("CONDYLE_LANES", str(request.param))
    return request.param


def kernel() -> CompiledKernel:
    return CompiledKernel("functions while values wait", lambda: FUNCTIONS, no_numbers())


def samples(count: int) -> np.ndarray:
    """x and y where every function is defined, (count, 2)."""
    return np.random.default_rng(0).uniform(0.1, 0.9, (count, 2))


def run(given: np.ndarray) -> dict[str, np.ndarray]:
    return kernel().run({"x": given}).values


def require_same(got: dict[str, np.ndarray], wanted: dict[str, Any], where: Any = ...) -> None:
    """To the last digit."""
    for name, value in wanted.items():
        np.testing.assert_array_equal(got[name][where], value[where], err_msg=name)


def by_library(name: str) -> Callable[..., float]:
    """A function of the C library, as Python hands it on."""

    def function(*args: float) -> float:
        try:
            return getattr(math, name)(*args)
        except ValueError:
            return math.nan
        except OverflowError:
            return math.inf

    return function


def test_strange_lanes(width: int) -> None:
    """One lane of a vector far off, infinite or no number: its neighbours keep every digit, and it
    has what the C library says."""
    places = list(product(range(width), STRANGE, ([0], [1], [0, 1])))
    plain = samples(width * len(places))
    strange = plain.copy()
    rows = np.array([width * i + lane for i, (lane, _, _) in enumerate(places)])
    for row, (_, value, columns) in zip(rows, places, strict=True):
        strange[row, columns] = value
    got = run(strange)
    require_same(got, run(plain), np.setdiff1d(np.arange(len(plain)), rows))
    far = rows[[0 in columns for _, _, columns in places]]
    for name in ("sin", "cos", "exp", "tanh"):
        wanted = [by_library(name)(x) for x in strange[far, 0]]
        np.testing.assert_array_equal(got[name][far], wanted, err_msg=name)
    # Arcs that vectors have are two units of the last place off at most: see test_vector.
    with np.errstate(over="ignore"):
        total = np.abs(strange[rows]).sum(axis=1)
    for name, some in (("hypot", rows), ("atan2", rows[~((total > 0) & (total < 1e308))])):
        wanted = [by_library(name)(*point) for point in strange[some]]
        np.testing.assert_array_equal(got[name][some], wanted, err_msg=name)


@pytest.mark.usefixtures("width")
def test_strange_numbers_alone() -> None:
    """In one evaluation: what the C library says, between an eighth of a turn and a million too."""
    own = kernel()
    results = [r.name for r in own.interface.results]
    for x, y in product((*STRANGE, 0.8, 3.0, -40.0, 1e5), (0.3, -2.0)):
        found = dict(zip(results, own.evaluate(np.array([x, y]))[0], strict=True))
        for name in ("sin", "cos", "exp", "tanh"):
            wanted = by_library(name)(x)
            np.testing.assert_allclose(found[name], wanted, rtol=1e-15, err_msg=f"{name} {x}")


def test_every_size_and_stride(width: int) -> None:
    """Numpy's values; columns side by side, apart, backwards, one number for all samples."""
    whole = samples(2 * width + 1)
    wanted = run(np.asfortranarray(whole))
    plain = NumpyKernel(FUNCTIONS, no_numbers()).run({"x": whole}).values
    for name, value in wanted.items():
        assert (np.abs(value - plain[name]) < 5e-15 * np.maximum(np.abs(plain[name]), 1)).all()
    for count in range(1, 2 * width + 2):
        require_same(run(whole[:count]), {name: value[:count] for name, value in wanted.items()})
    apart = np.zeros((3 * len(whole), 4))
    apart[::3, 1::2] = whole
    backwards = np.ascontiguousarray(whole[::-1])[::-1]
    for given in (whole, apart[::3, 1::2], backwards):
        require_same(run(given), wanted)
    constant = np.broadcast_to(whole[3], whole.shape)
    require_same(run(constant), {name: np.full(len(whole), v[3]) for name, v in wanted.items()})
    one = np.lib.stride_tricks.as_strided(np.array([0.5]), whole.shape, (0, 0))
    require_same(run(one), run(np.full(whole.shape, 0.5)))


def require_numbers(p: Program, numbers: Numbers, inputs: dict[str, np.ndarray]) -> None:
    """As the backend of numpy, to rounding: in batches and one by one."""
    wanted = NumpyKernel(Programs(p), numbers).run(inputs).values
    key = f"{p.counts} chains, {len(p.graph.nodes)} values"
    own = CompiledKernel(key, lambda: Programs(p, single=True), numbers)
    _, columns = columns_of(own.interface, inputs, own.order)
    for found in (own.run(inputs).values, ones(own, np.column_stack(columns))[0]):
        for name, value in found.items():
            assert error(value, wanted[name]) < 1e-14, name


@pytest.mark.usefixtures("width")
def test_reductions_and_long_chains() -> None:
    """Sums and minima over chains of two groups: of products, of differences, of what all share.
    Long chains run in a loop. What fills up the vectors of a group, the next one's samples, counts
    in none."""
    graph, (near, far) = Graph(), (3, 2)
    x = graph.leaf("input", 0)
    a, b = graph.leaf("lane_input", 0, 1, group=0), graph.leaf("lane_input", 1, 1 + near, group=1)
    c = graph.leaf("lane", 0, 0, group=0)
    product, difference = graph.apply("mul", a, c), graph.apply("sub", graph.apply("mul", b, b), b)
    roots = [graph.reduce("sum", [product, difference])]
    late = graph.apply("mul", a, roots[0])
    for op in REDUCTIONS:
        each = [a, b], [x, b], [a, x], [x, x], [c, b], [late, b]
        roots += [graph.reduce(op, terms) for terms in each]
    outputs = tuple(Output(str(i), (), "", False, ((v,),)) for i, v in enumerate(roots))
    ports = (Port("x", 1, "", False, 0), Port("y", 1, "", True, 1))
    p = Program(graph, (near, far), 1 + near + far, ports, outputs, ())
    fixed, one = (np.array([[[2.0, -3.0, 5.0]]]), np.zeros((1, 1, far))), np.zeros((1, 1))
    numbers = Numbers(one, fixed, (one, one), (3, 0, 4, 1, 2))
    given = np.random.default_rng(0).normal(size=(7, p.columns))
    require_numbers(p, numbers, {"x": given[:, :1], "y": given[:, 1:]})

    graph = Graph()
    v = first = graph.leaf("lane_input", 0, 0, group=0)
    for _ in range(LONG):
        v = graph.apply("add", graph.apply("mul", v, graph.const(0.5)), first)
    p = program(graph, [graph.reduce("sum", [v])], LANES)
    p = replace(p, ports=(Port("y", 1, "", True, 0),))
    assert Loops(fused(p), 8).rolled
    require_numbers(p, no_numbers(), {"y": given[:5, :LANES]})
