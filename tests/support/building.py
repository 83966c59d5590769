"""Kernels for tests: a cache folder of their own, and a compiler that is quick because it does not
optimise. The rooms in `OWN_CACHE` always use that folder; the others use the person's."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from condyle.backends import notice
from condyle.backends.compiler import CompilerError, find_compiler

OWN_CACHE = {"backends", "graph", "model", "questions", "results", "simulation"}
TESTS = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def kernel_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all tests (of all workers), so that no kernel is built twice."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "built-kernels"
    folder.mkdir(exist_ok=True, mode=0o700)
    return folder


@pytest.fixture(scope="module", autouse=True)
def kernel_cache(request: pytest.FixtureRequest, kernel_folder: Path) -> Iterator[None]:
    if request.path.relative_to(TESTS).parts[0] not in OWN_CACHE:
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CONDYLE_CACHE", str(kernel_folder))
        yield


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notice, "_said", set())


@pytest.fixture(scope="session")
def compiler_command() -> tuple[str, ...]:
    """The compiler of this machine; without one the test is skipped."""
    try:
        return find_compiler().command
    except CompilerError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def unoptimised_command(kernel_folder: Path, compiler_command: tuple[str, ...]) -> str:
    """The compiler without optimisation: builds take half a second."""
    return script(kernel_folder / "unoptimised", f'exec {shlex.join(compiler_command)} "$@" -O0')


@pytest.fixture
def unoptimised(unoptimised_command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", unoptimised_command)


def script(path: Path, body: str) -> str:
    """A shell script as a command for CC."""
    path.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    return shlex.join(["/bin/sh", str(path)])
