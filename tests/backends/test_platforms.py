"""Other systems, as far as they can be told from here: which compiler is called, and how."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from condyle.backends import cache, compiler
from condyle.backends.compiler import CompilerError

GCC = '#define __VERSION__ "13.2.0"\n#define __GNUC__ 13\n'
CLANG = '#define __VERSION__ "Clang 18"\n#define __clang__ 1\n'
AVX = "#define __AVX2__ 1\n#define __AVX512F__ 1\n"


class Machine:
    """A system whose compilers say what they are, and take down how they are called."""

    def __init__(self, patch: pytest.MonkeyPatch, compilers: dict[str, str], windows: bool) -> None:
        self.calls: list[list[str]] = []
        patch.setattr(compiler, "WINDOWS", windows)
        patch.setattr(
            compiler.shutil, "which", lambda name, path=None: name if name in compilers else None
        )
        patch.setattr(compiler, "find_spec", lambda name: object() if "zig" in compilers else None)
        patch.setattr(compiler, "_macros", lambda command, native: self.macros(command, native))
        self._compilers = compilers
        if "zig" in compilers:
            compilers[sys.executable] = compilers["zig"]

    def macros(self, command: tuple[str, ...], native: tuple[str, ...]) -> str | None:
        said = self._compilers[command[0]]
        if "__clang__" in said and compiler.GCC in native:
            return None
        return said if "-mno-avx" in native else said + AVX


def test_mingw_makes_no_vectors_of_avx(monkeypatch: pytest.MonkeyPatch) -> None:
    Machine(monkeypatch, {"gcc": GCC}, windows=True)
    found = compiler._search("", "", "")
    assert found.command == ("gcc",) and found.lanes == 2
    assert "-mno-avx" in found.flags and "-fPIC" not in found.flags and "-shared" in found.flags


def test_clang_for_mingw_may_have_them(monkeypatch: pytest.MonkeyPatch) -> None:
    Machine(monkeypatch, {"clang": CLANG}, windows=True)
    found = compiler._search("", "", "")
    assert found.lanes == 8 and "-mno-avx" not in found.flags


def test_the_compiler_of_a_wheel_stands_in(monkeypatch: pytest.MonkeyPatch) -> None:
    Machine(monkeypatch, {"zig": CLANG}, windows=True)
    assert compiler._search("", "", "").command == (sys.executable, "-m", "ziglang", "cc")


@pytest.mark.parametrize("cc", ["cl", "cl.exe", "clang-cl"])
def test_microsofts_compiler_is_refused_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, cc: str
) -> None:
    Machine(monkeypatch, {cc: GCC}, windows=True)
    with pytest.raises(CompilerError, match="MinGW's gcc does, or pip install ziglang"):
        compiler._search(cc, "", "")


def test_clang_in_its_place_too(monkeypatch: pytest.MonkeyPatch) -> None:
    Machine(monkeypatch, {"clang": CLANG + "#define _MSC_VER 1940\n"}, windows=True)
    with pytest.raises(CompilerError, match=r"clang .takes other C"):
        compiler._search("", "", "")


def test_elsewhere_code_may_be_anywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    Machine(monkeypatch, {"gcc": GCC}, windows=False)
    found = compiler._search("", "", "")
    assert "-fPIC" in found.flags and found.lanes == 8


def test_a_loaded_library_is_left_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Windows does not let it be replaced; another file of its name is an error."""
    source, target = tmp_path / "new", tmp_path / "old"

    def refuse(*paths: object) -> None:
        raise PermissionError(13, "in use")

    monkeypatch.setattr(os, "replace", refuse)
    for text in (b"kernel", b"another"):
        source.write_bytes(b"kernel")
        target.write_bytes(text)
        if text == b"kernel":
            cache._place(source, target)
        else:
            with pytest.raises(PermissionError):
                cache._place(source, target)
        assert target.read_bytes() == text
