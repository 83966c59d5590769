"""Batches as assembly, printed and run: every size and stride, strange lanes, the C library.

Where the processor has no AVX2 or AVX-512 the batch is C, of which the same must hold.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cases import case, error
from support.programs import no_numbers, program

from condyle.backends.c.emit import emit
from condyle.backends.c.kernel import CompiledKernel
from condyle.backends.c.x86.text import REGISTERS
from condyle.backends.compiler import Compiler, find_compiler
from condyle.backends.numpy import NumpyKernel
from condyle.graph.graph import Graph
from condyle.graph.program import Output, Program, Variants
from condyle.model.evaluator import Evaluator

ONE = (
    *("exp", "expm1", "log", "log1p", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("asinh", "atanh", "erf", "floor", "ceil", "sign"),
)
TWO = ("pow", "hypot", "fmod", "remainder")
WAITING = 40  # values that wait while the C library is asked: more than there are registers
STRANGE = (1e7, -1e7, 1.7e308, math.inf, -math.inf, math.nan, -0.0)
CLOSE = 1e-13

pytestmark = pytest.mark.usefixtures("quick")


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
    found |= {name: apply(name, late) for name in ONE}
    found |= {name: apply(name, late, y) for name in TWO}
    found["le"] = apply("le", found["floor"], graph.const(0.0))
    for k, v in enumerate(waiting):
        called = found[(*ONE, *TWO)[k % len((*ONE, *TWO))]]
        total = apply("add", total, apply("mul", v, called))
    found["total"] = total
    p = program(graph, list(found.values()), 2)
    return Program(
        graph,
        p.counts,
        2,
        p.ports,
        tuple(Output(name, (), "", False, ((v,),)) for name, v in found.items()),
        (),
    )


FUNCTIONS = Variants(functions(), single=True)


@pytest.fixture(params=REGISTERS)
def width(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setenv("CONDYLE_LANES", str(request.param))
    return request.param


def kernel() -> CompiledKernel:
    return CompiledKernel("functions of x86", lambda: FUNCTIONS, no_numbers())


def samples(count: int) -> np.ndarray:
    """x and y where every function is defined, (count, 2)."""
    return np.random.default_rng(0).uniform(0.1, 0.9, (count, 2))


def run(given: np.ndarray) -> dict[str, np.ndarray]:
    return kernel().run({"x": given}).values


def same(got: dict[str, np.ndarray], wanted: dict[str, np.ndarray], where: Any = ...) -> None:
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


@pytest.mark.usefixtures("width")
def test_functions_while_values_wait() -> None:
    given = samples(203)
    wanted = NumpyKernel(FUNCTIONS, no_numbers()).run({"x": given}).values
    for name, value in run(given).items():
        off = np.abs(value - wanted[name]) / np.maximum(np.abs(wanted[name]), 1.0)
        assert off.max() < 5e-15, name


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
    same(got, run(plain), np.setdiff1d(np.arange(len(plain)), rows))
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
        found = dict(zip(results, own.one(np.array([x, y]))[0], strict=True))
        for name in ("sin", "cos", "exp", "tanh"):
            wanted = by_library(name)(x)
            np.testing.assert_allclose(found[name], wanted, rtol=1e-15, err_msg=f"{name} {x}")


def test_every_size(width: int) -> None:
    whole = samples(2 * width + 1)
    wanted = run(whole)
    for count in range(1, 2 * width + 2):
        same(run(whole[:count]), {name: value[:count] for name, value in wanted.items()})


def test_every_stride(width: int) -> None:
    """Columns side by side, apart, backwards, and one number for all samples."""
    whole = samples(2 * width + 1)
    wanted = run(np.asfortranarray(whole))
    apart = np.zeros((3 * len(whole), 4))
    apart[::3, 1::2] = whole
    backwards = np.ascontiguousarray(whole[::-1])[::-1]
    for given in (whole, apart[::3, 1::2], backwards):
        same(run(given), wanted)
    constant = np.broadcast_to(whole[3], whole.shape)
    same(run(constant), {name: np.full(len(whole), v[3]) for name, v in wanted.items()})
    mixed = np.broadcast_to(np.float64(0.5), (2, len(whole))).T
    mixed = np.lib.stride_tricks.as_strided(mixed, mixed.shape, (0, 0))
    same(run(mixed), run(np.full(whole.shape, 0.5)))


@pytest.mark.parametrize(
    ("name", "question", "details", "width"),
    [
        ("masticatory", "inverse", (("contact", "motion", "joint"),), 8),
        ("masticatory-curved", "forward", ((),), 4),
        ("mixed_k2_n8", "inverse", ((),), 4),
        ("rss_k2_n6_profile", "motion", (), 8),
    ],
    indirect=["width"],
)
def test_assembly_is_c(
    name: str,
    question: str,
    details: tuple[tuple[str, ...], ...],
    width: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The same numbers and statuses, of states that are reached, doubtful and out of reach."""
    needs_assembly()
    c = case(name).repeated(2 * width + 3)
    c.q[1] *= 1e3
    c.q[2] = np.nan
    effort = np.random.default_rng(0).normal(size=(len(c.q), len(c.mechanism.chains)))
    found = []
    for assembly in (True, False):
        monkeypatch.setattr(Compiler, "assembly", assembly)
        # Nobody asks one machine for both, so that their kernels have one name.
        (tmp_path / str(assembly)).mkdir(mode=0o700)
        monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path / str(assembly)))
        own = Evaluator(c.mechanism, backend="compiled").kernel(question, *details)
        assert isinstance(own, CompiledKernel) and not own.cached
        found.append(own.run({**c.inputs, "effort": effort}))
    (values, status), (wanted, truth) = ((a.values, a.status) for a in found)
    np.testing.assert_array_equal(status, truth)
    assert (status == 0).sum() > width and status.any()
    for result, value in wanted.items():
        assert error(values[result][..., truth == 0], value[..., truth == 0]) < CLOSE, result


def needs_assembly() -> None:
    if not find_compiler().assembly:
        pytest.skip("this processor, or its compiler, has no such vectors")


# -- what is printed -----------------------------------------------------------------------------


def test_the_assembler_takes_it(width: int, tmp_path: Path) -> None:
    """On every x86-64, whatever its vectors are."""
    compiler = find_compiler()
    if "#define __x86_64__ " not in compiler.identity:
        pytest.skip("not an x86-64")
    source, target = tmp_path / "batch.c", tmp_path / "batch.o"
    source.write_text(emit(FUNCTIONS, width, assembly=True).batch, encoding="utf-8")
    compiler.compile(source, target, compiler.flags)
    assert target.stat().st_size


def test_assembly_where_it_is_asked_for(width: int) -> None:
    for assembly in (True, False):
        assert ("__asm__(" in emit(FUNCTIONS, width, assembly).batch) == assembly


AVX512 = ("__AVX512F__", "__AVX512DQ__", "__AVX512VL__")
MACROS = ("__x86_64__", "__AVX2__", "__FMA__", *AVX512)


@pytest.mark.parametrize(
    ("lanes", "missing", "wanted"),
    [
        *((lanes, "", True) for lanes in REGISTERS),
        (2, "", False),
        *((lanes, "__x86_64__", False) for lanes in REGISTERS),
        *((4, name, False) for name in ("__AVX2__", "__FMA__")),
        *((8, name, False) for name in AVX512),
        (4, "__AVX512F__", True),
    ],
)
def test_who_is_asked(lanes: int, missing: str, wanted: bool) -> None:
    """The compiler's macros, not the machine that this runs on."""
    identity = "".join(f"#define {name} 1\n" for name in MACROS if name != missing)
    assert Compiler(("cc",), (), identity, lanes).assembly == wanted
