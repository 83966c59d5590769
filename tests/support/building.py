"""Kernels of tests: one cache for all rooms and workers, kept from run to run, and a compiler that
is quick because it does not optimise. A test of optimised code asks for the fixture `optimised`.
"""

from __future__ import annotations

import os
import shlex
import tempfile
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import pytest

from condyle.backends import notice
from condyle.backends.compiler import CompilerError, find_compiler
from condyle.questions import Question

KEPT = 100  # questions
ROOT = Path(__file__).parents[2]
# The person's CC, or that of .ci/narrow: what it was before this module set it, in workers too.
GIVEN = os.environ.setdefault("CONDYLE_TEST_CC", os.environ.get("CC", ""))


def share_kernels() -> None:
    """Point this process and all that it starts to the kernels of tests.

    CONDYLE_TEST_KERNELS names another folder than `build/kernels` of the tree.
    """
    folder = Path(os.environ.get("CONDYLE_TEST_KERNELS") or ROOT / "build" / "kernels")
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError:  # a tree that cannot be written
        folder = Path(tempfile.gettempdir()) / f"condyle-test-kernels-{os.getpid()}"
        folder.mkdir(exist_ok=True, mode=0o700)
    os.environ.setdefault("CONDYLE_CACHE", str(folder))
    if not os.environ.get("CC"):  # workers have it from the process that starts them
        with suppress(CompilerError):  # tests that need one say so
            os.environ["CC"] = unoptimised(folder, find_compiler().command)


def write_once() -> None:
    """Let equations of one structure, which models derive again and again, be written once."""
    anew = Question.variants
    kept = lru_cache(maxsize=KEPT)(anew)
    Question.variants = lambda self: anew(self) if self.key is None else kept(self)  # type: ignore[method-assign]


def unoptimised(folder: Path, command: tuple[str, ...]) -> str:
    """A command for CC: the compiler with -O0 behind its other options."""
    return script(folder / "unoptimised", f'exec {shlex.join(command)} "$@" -O0')


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notice, "_printed", set())


@pytest.fixture(scope="session")
def compiler_command() -> tuple[str, ...]:
    """The compiler of this machine; without one the test is skipped."""
    with pytest.MonkeyPatch.context() as patch:
        restore_compiler(patch)
        try:
            return find_compiler().command
        except CompilerError as error:
            pytest.skip(str(error))


@pytest.fixture
def optimised(compiler_command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels as people get them, for what holds optimised code to its digits or counts it."""
    restore_compiler(monkeypatch)


def restore_compiler(patch: pytest.MonkeyPatch) -> None:
    if GIVEN:
        patch.setenv("CC", GIVEN)
    else:
        patch.delenv("CC", raising=False)


@pytest.fixture(scope="session")
def kernel_folder() -> Path:
    """The folder of all tests' kernels."""
    return Path(os.environ["CONDYLE_CACHE"])


def script(path: Path, body: str) -> str:
    """A shell script as a command for CC."""
    new = path.with_name(f"{path.name}.{os.getpid()}")
    new.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    new.replace(path)
    return shlex.join(["/bin/sh", str(path)])
