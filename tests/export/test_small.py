"""Exports for small machines: loops in the place of repeated statements, the same numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from export.conftest import FOLDERS, Library
from export.test_compilers import CORTEX, require_right
from export.test_controller import BITE
from support.tools import need, run

from condyle.errors import InputError
from condyle.export import export
from condyle.export.c_package import write_package
from condyle.export.controller import controller_source
from condyle.graph.graph import Graph
from condyle.graph.repeats import Repeat, segments

ci = pytest.mark.ci
MOST = 128_000  # bytes of an observer and limits on a small processor


@pytest.mark.parametrize("name", ["limited", *(pytest.param(n, marks=ci) for n in FOLDERS)])
def test_recorded_samples(name: str, tmp_path: Path) -> None:
    need("gcc", "size")
    mechanism, options = FOLDERS[name]
    bytes_of = {}
    for size in ("fast", "small"):
        (folder := tmp_path / size).mkdir()
        exported = export(mechanism(), **options, lanes=0, size=size)
        write_package(exported, folder)
        require_right(run("make", "-s", "check", "CFLAGS=-Os", folder=folder), exported)
        source = f"{exported.prefix}.c"
        run("gcc", "-Os", "-c", source, "-o", "code.o", folder=folder)
        bytes_of[size] = int(run("size", "code.o", folder=folder).split()[6])
    assert bytes_of["small"] < 0.6 * bytes_of["fast"]


@pytest.mark.parametrize("bound_rate", [None, pytest.param(50.0, marks=ci)])
def test_ticks(bound_rate: float | None, tmp_path: Path) -> None:
    """Observer, bite force and limits, tick after tick from what the last one left."""
    need("gcc", "arm-none-eabi-gcc", "arm-none-eabi-size")
    keeps = {} if bound_rate is None else {"bound_rate": bound_rate, "keep_bounds": True}
    scenario = BITE | {"controller": BITE["controller"] | keeps}
    ticks = {}
    for size in ("fast", "small"):
        (folder := tmp_path / size).mkdir()
        made = controller_source("masticatory", scenario, None, size)
        ticks[size] = Library(made.exported, folder)
    tick, rng = ticks["fast"].exported["tick"], np.random.default_rng(2)
    given = {a.name: 1e-3 * rng.uniform(0.5, 1, a.size) for a in tick.inputs}
    given["covariance_before"] = np.zeros_like(given["covariance_before"])
    good = 0
    for _ in range(40):
        given["joint"] = 0.02 * rng.normal(size=given["joint"].size)
        status, right = ticks["fast"]("tick", **given)
        again, found = ticks["small"]("tick", **given)
        assert status == again
        for key, value in right.items():
            scale = np.abs(value).max() + 1e-12
            np.testing.assert_allclose(found[key] / scale, value / scale, atol=1e-6)
        if status == 0:
            good += 1
            given |= {f"{key}_before": right[key] for key in right if f"{key}_before" in given}
    assert good > 20
    code = made.exported.prefix
    call = ["arm-none-eabi-gcc", "-std=c99", "-O2", *CORTEX.split(), "-c", f"{code}.c"]
    run(*call, "-o", "code.o", folder=folder)
    assert int(run("arm-none-eabi-size", "code.o", folder=folder).split()[6]) < MOST


def test_segments_are_the_values_in_order() -> None:
    """A loop of ten steps among other values, whose state has two numbers; one step is too few."""
    g = Graph()
    a, b = (g.leaf("input", i) for i in range(2))
    c = g.apply("mul", a, b)
    for _ in range(10):
        x = a
        for _ in range(12):
            x = g.apply("sin", g.apply("add", x, c))
        a, b = x, g.apply("add", b, x)
    parts = list(segments(g, range(len(g.nodes)), [b]))
    (repeat,) = (part for part in parts if isinstance(part, Repeat))
    assert len(repeat.blocks) >= 9 and len(repeat.carried) == 2
    flat = [v for p in parts for v in (sum(p.blocks, ()) if isinstance(p, Repeat) else p)]
    assert flat == list(range(len(g.nodes)))


def test_a_wrong_size() -> None:
    with pytest.raises(InputError, match="fast or small"):
        export(FOLDERS["limited"][0](), size="tiny")
