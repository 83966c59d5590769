"""Every operation of the table: numpy, C and CasADi compute the same."""

from __future__ import annotations

import numpy as np
import pytest
from support.cases import ones
from support.programs import LANES, by_casadi, no_numbers, program

from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.graph.graph import Graph, Value
from condyle.graph.operations import OPERATIONS
from condyle.graph.program import Numbers, Output, Port, Program, Programs

COUNT = 203
# Where functions of one argument are defined; elsewhere everything between -3 and 3.
DOMAIN = {
    **dict.fromkeys(("asin", "acos", "atanh"), (-0.999, 0.999)),
    **dict.fromkeys(("log", "sqrt", "pow"), (1e-3, 3.0)),
    "log1p": (-0.99, 3.0),
    "acosh": (1.001, 3.0),
}
COMPARED = ("le", "lt", "eq", "ne", "and", "or", "not", "where", "fmin", "fmax", "sign", "copysign")
SPECIAL = np.array([0.0, -0.0, 1.0, -1.0, 2.0])  # where comparisons and jumps decide
BINARY = (
    *("add", "sub", "mul", "div", "atan2", "pow", "hypot", "fmin", "fmax", "fmod", "remainder"),
    *("copysign", "le", "lt", "eq", "ne", "and", "or", "where"),
)
ARITY = {name: 3 if name in ("fma", "fnma") else 1 + (name in BINARY) for name in OPERATIONS}


def columns(name: str, rng: np.random.Generator, count: int) -> np.ndarray:
    """Arguments, (count, arity)."""
    low, high = DOMAIN.get(name, (-3.0, 3.0))
    found = rng.uniform(low, high, (count, ARITY[name]))
    if name in COMPARED:
        found[::2] = rng.choice(SPECIAL, (len(found[::2]), ARITY[name]))
    if name == "pow":
        found[:, 1] = rng.uniform(-2.5, 2.5, count)
    if name in ("fmod", "remainder", "div"):
        found[:, 1] = np.copysign(rng.uniform(0.3, 2, count), found[:, 1])
    return found


def everything() -> tuple[Program, Numbers, np.ndarray]:
    """Each operation of a sample, of a lane, and of parameters, side by side."""
    graph, rng = Graph(), np.random.default_rng(0)
    total = sum(ARITY.values())
    outputs, samples, parameters = [], [], []
    column = 0
    for name, arity in ARITY.items():
        given: list[Value] = [graph.leaf("input", column + i) for i in range(arity)]
        start = total + LANES * column
        lanes = [graph.leaf("lane_input", 0, start + LANES * i, group=0) for i in range(arity)]
        fixed = [graph.leaf("parameter", column + i) for i in range(arity)]
        for kind, args in (("sample", given), ("lane", lanes), ("parameter", fixed)):
            value = graph.apply(name, *args)
            outputs.append(Output(f"{name} {kind}", (), "", kind == "lane", ((value,),)))
        samples.append(columns(name, rng, COUNT))
        parameters.append(columns(name, rng, 2)[1])
        column += arity
    for name in ARITY:
        samples.append(
            np.stack([columns(name, rng, COUNT) for _ in range(LANES)], axis=2).reshape(COUNT, -1)
        )
    ports = (Port("x", total, "", False, 0), Port("y", total, "", True, total))
    p = Program(graph, (LANES,), total * (1 + LANES), ports, tuple(outputs), ())
    numbers = Numbers(
        np.concatenate(parameters)[None], (np.zeros((1, 1, LANES)),), (np.zeros((1, 1)),), (0, 1, 2)
    )
    return p, numbers, np.hstack(samples)


PROGRAM, NUMBERS, SAMPLES = everything()
VARIANTS = Programs(PROGRAM, single=True)


def inputs(samples: np.ndarray) -> dict[str, np.ndarray]:
    size = PROGRAM.ports[0].size
    return {"x": samples[:, :size], "y": samples[:, size:].reshape(len(samples), size, LANES)}


def differences(got: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> dict[str, float]:
    """Largest difference of each result, over its value or one."""
    assert list(got) == list(wanted)
    found = {}
    for name, value in wanted.items():
        assert got[name].shape == value.shape
        off = np.abs(got[name] - value) / np.maximum(np.abs(value), 1.0)
        found[name] = float(off.max())
    return found


def test_numpy_is_casadi() -> None:
    got = NumpyKernel(VARIANTS, NUMBERS).run(inputs(SAMPLES)).values
    off = differences(got, by_casadi(PROGRAM, NUMBERS, SAMPLES))
    assert max(off.values()) < 5e-15, {k: v for k, v in off.items() if v >= 5e-15}
    assert len(off) == 3 * len(OPERATIONS)


@pytest.mark.parametrize("width", ["2", "4", "8"])
@pytest.mark.usefixtures("compiler_command")
def test_c_is_numpy(width: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a batch, in one evaluation as scalars and as vectors, and where numbers are prepared."""
    monkeypatch.setenv("CONDYLE_LANES", width)
    wanted = NumpyKernel(VARIANTS, NUMBERS).run(inputs(SAMPLES)).values
    kernel = CompiledKernel("every operation", lambda: VARIANTS, NUMBERS)
    for got in (kernel.run(inputs(SAMPLES)).values, ones(kernel, SAMPLES)[0]):
        off = differences(got, wanted)
        assert max(off.values()) < 5e-15, {k: v for k, v in off.items() if v >= 5e-15}


@pytest.mark.usefixtures("compiler_command")
def test_extremes_and_comparisons_of_what_is_no_number() -> None:
    """A minimum or maximum is its second argument then; no comparison holds but "not equal"."""
    nan = float("nan")
    pairs = np.array([[nan, 1.0], [1.0, nan], [nan, nan], [2.0, 1.0]])
    wanted = {
        "fmin": [1.0, nan, nan, 1.0],
        "fmax": [1.0, nan, nan, 2.0],
        **dict.fromkeys(("le", "lt", "eq"), [0.0] * 4),
        "ne": [1.0] * 4,
    }
    graph = Graph()
    both = graph.leaf("input", 0), graph.leaf("input", 1)
    # Graphs sort the arguments of extremes; not these.
    roots = [graph._node(name, both, (), None, True, 0) for name in wanted]
    variants = Programs(program(graph, roots, 2), single=True)
    kernel = CompiledKernel("no numbers", lambda: variants, no_numbers())
    for found in (
        NumpyKernel(variants, no_numbers()).run({"x": pairs}).values,
        kernel.run({"x": pairs}).values,
        ones(kernel, pairs)[0],
    ):
        for values, (name, right) in zip(found.values(), wanted.items(), strict=True):
            np.testing.assert_array_equal(values, right, err_msg=name)
