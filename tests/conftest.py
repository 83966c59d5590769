"""Shared by all tests: the oracles on the import path, mechanisms, and a runner of the command."""

from __future__ import annotations

import os
import sys
import tomllib
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.mechanism import bundled_text

# `from oracles import ...` and `from benchmarks import ...` from any folder.
sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

from support.browser import browser, open_tab  # noqa: F401 - fixtures
from support.building import (  # noqa: F401 - fixtures
    compiler_command,
    kernel_folder,
    nothing_said,
    optimised,
    share_kernels,
    write_once,
)
from support.skips import (  # noqa: F401 - hooks
    pytest_collectreport,
    pytest_runtest_logreport,
    pytest_sessionfinish,
    pytest_terminal_summary,
)

# What says of a terminal how wide and how coloured it is: no test may depend on it. Typer looks as
# it is imported.
for _name in ("FORCE_COLOR", "GITHUB_ACTIONS", "LINES", "NO_COLOR", "PY_COLORS", "TERMINAL_WIDTH"):
    os.environ.pop(_name, None)
os.environ["COLUMNS"] = "100"
share_kernels()
write_once()

TESTS = Path(__file__).parent
# Tests that need a compiler, a browser or another program, or draw pages, are slow without a mark.
SLOW_FIXTURES = {"browser", "compiler_command"}
COMPILED_ROOMS = {"backends", "bench", "simulation"}
SLOW_ROOMS = COMPILED_ROOMS | {"docs", "export", "report", "view"}


def room(item: pytest.Item) -> str:
    return item.path.relative_to(TESTS).parts[0]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        asks = SLOW_FIXTURES & {*getattr(item, "fixturenames", ())}
        if asks or room(item) in SLOW_ROOMS:
            item.add_marker(pytest.mark.slow)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Tests that ask for no compiler run kernels by numpy, unless they name a backend."""
    compiled = "compiler_command" in getattr(item, "fixturenames", ())
    with pytest.MonkeyPatch.context() as patch:
        for name in ("CONDYLE_BACKEND", "CONDYLE_LANES"):
            patch.delenv(name, raising=False)
        if not compiled and room(item) not in COMPILED_ROOMS:
            patch.setenv("CONDYLE_BACKEND", "numpy")
        return (yield)


@pytest.fixture(scope="session")
def reference() -> condyle.Mechanism:
    """The bundled mechanism of the paper."""
    return condyle.load_mechanism("masticatory")


@pytest.fixture(scope="session")
def torn(reference: condyle.Mechanism) -> xr.Dataset:
    """Away and back under a load: samples 15 to 88 of 201 are out of reach."""
    t = np.linspace(0, 1, 201)
    names = ("X", "Y", "alpha", "beta")
    motion = condyle.Motion.from_arrays(t, {n: 0.03 * np.sin(6 * t) * (n == "X") for n in names})
    push = condyle.Load.constant((0, 0, -30), point="right_molar")
    return condyle.derive(reference, backend="interpreted").solve(motion, push, flag=True)


@pytest.fixture
def raw() -> dict[str, Any]:
    """The tables of the bundled file, to be spoiled; lengths in mm."""
    return tomllib.loads(bundled_text("masticatory"))


@dataclass(frozen=True)
class Outcome:
    """What a run of the command left behind."""

    status: int
    out: str
    err: str


@pytest.fixture
def condyle_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Callable[..., Outcome]:
    """Runs `condyle ...` in this process, in an empty folder."""
    from condyle.cli import main

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TERM", "dumb")

    def run(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["condyle", *map(str, arguments)])
        status = 0
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # numpy's would end up on stderr
            try:
                main()
            except SystemExit as stop:
                status = int(stop.code or 0)
        text = capsys.readouterr()
        return Outcome(status, text.out, text.err)

    return run
