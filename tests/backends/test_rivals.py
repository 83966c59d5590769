"""Two compilers: both build one evaluation, the quicker is kept, a broken rival does no harm."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from condyle.backends import cache, compiler
from condyle.backends.c import build
from condyle.backends.c.kernel import CompiledKernel
from condyle.graph.program import Variants
from condyle.mechanism.mechanism import Mechanism
from condyle.questions import Question
from condyle.questions.numbers import Layout
from condyle.questions.structure import structure_of

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
RIVAL = """#!/bin/sh
case "$*" in
*single*) {broken} ;;
esac
# GCC does not know what is Clang's alone.
for flag; do
  shift
  case "$flag" in
  -fno-slp-vectorize | -mllvm | -enable-misched=false) ;;
  *) set -- "$@" "$flag" ;;
  esac
done
exec gcc "$@" -D__clang__=1 -O1
"""


def kernel(reference: Mechanism) -> CompiledKernel:
    structure = structure_of(reference, "virtual_power", "core")
    question = Question.about(structure, "inverse", ())
    built: list[Variants] = []

    def once() -> Variants:
        built.append(question.variants())
        return built[0]

    return CompiledKernel(question.key, once, Layout.of(structure).numbers(reference))


@pytest.fixture
def beside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder first on the path, for a clang of our own beside gcc."""
    tools = tmp_path / "tools"
    tools.mkdir()
    for name in ("cc", "gcc", "as", "ld", "sh"):
        if found := shutil.which(name):
            (tools / name).symlink_to(found)
    monkeypatch.setenv("PATH", str(tools))
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)
    return tools


def clang(folder: Path, broken: str = ":") -> None:
    (folder / "clang").write_text(RIVAL.format(broken=broken))
    (folder / "clang").chmod(0o755)


@pytest.mark.parametrize("winner", [0, 1])
def test_the_quicker_one_is_kept(
    reference: Mechanism, beside: Path, monkeypatch: pytest.MonkeyPatch, winner: int
) -> None:
    clang(beside)
    first, second = compiler.rivals(compiler.find_compiler())
    assert second.command == ("clang",) and second.single_flags != first.single_flags
    times = [2.0, 1.0] if winner else [1.0, 2.0]
    monkeypatch.setattr(build, "_times", lambda *_: times)
    found = kernel(reference)
    assert found.facts["compiler"] == [("cc", "clang")[winner]]
    assert found.facts["nanoseconds"] == {"cc": times[0], "clang": times[1]}
    assert cache.contents().choices == {("cc", "clang")[winner]: 1}
    assert found.one(np.zeros(found.interface.columns))[1] == 0


def test_both_are_measured(reference: Mechanism, beside: Path) -> None:
    clang(beside)
    times = kernel(reference).facts["nanoseconds"]
    assert set(times) == {"cc", "clang"} and all(0 < t < 1e6 for t in times.values())


def test_a_rival_that_fails_is_left_out(reference: Mechanism, beside: Path) -> None:
    clang(beside, broken="echo no >&2; exit 1")
    found = kernel(reference)
    assert found.facts["compiler"] == ["cc"] and set(found.facts["nanoseconds"]) == {"cc"}


def test_a_named_compiler_has_no_rival(beside: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clang(beside)
    monkeypatch.setenv("CC", "gcc")
    assert [c.command for c in compiler.rivals(compiler.find_compiler())] == [("gcc",)]
