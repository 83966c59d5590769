"""Other systems, as far as they can be told from here: which compiler is called, and how."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from condyle.backends import cache, compiler
from condyle.backends.compiler import Compiler, CompilerError

GCC = '#define __VERSION__ "13.2.0"\n#define __GNUC__ 13\n'
CLANG = '#define __VERSION__ "Clang 18"\n#define __clang__ 1\n'
AVX = "#define __AVX2__ 1\n#define __AVX512F__ 1\n"


def found(patch: pytest.MonkeyPatch, name: str, said: str, windows: bool, cc: str = "") -> Compiler:
    """What is taken on a system whose only compiler says of itself what is said."""

    program = sys.executable if name == "zig" else name

    def macros(command: tuple[str, ...], native: tuple[str, ...]) -> str | None:
        assert command[0] == program
        if "__clang__" in said and compiler.GCC in native:
            return None
        return said if "-mno-avx" in native else said + AVX

    patch.setattr(compiler, "WINDOWS", windows)
    patch.setattr(compiler.shutil, "which", lambda one, path=None: one if one == program else None)
    patch.setattr(compiler, "find_spec", lambda _: object() if name == "zig" else None)
    patch.setattr(compiler, "_macros", macros)
    return compiler._search(cc, "", "")


def test_which_compiler_is_called_and_how(monkeypatch: pytest.MonkeyPatch) -> None:
    """MinGW's gcc makes no vectors of AVX, clang may; that of a wheel stands in; elsewhere than on
    Windows code may be anywhere."""
    mingw = found(monkeypatch, "gcc", GCC, windows=True)
    assert mingw.command == ("gcc",) and mingw.lanes == 2
    assert "-mno-avx" in mingw.flags and "-fPIC" not in mingw.flags and "-shared" in mingw.flags
    clang = found(monkeypatch, "clang", CLANG, windows=True)
    assert clang.lanes == 8 and "-mno-avx" not in clang.flags
    zig = found(monkeypatch, "zig", CLANG, windows=True)
    assert zig.command == (sys.executable, "-m", "ziglang", "cc")
    elsewhere = found(monkeypatch, "gcc", GCC, windows=False)
    assert "-fPIC" in elsewhere.flags and elsewhere.lanes == 8


def test_a_path_of_windows_keeps_its_backslashes(monkeypatch: pytest.MonkeyPatch) -> None:
    path = r"C:\mingw64\bin\gcc.exe"
    spaced = r'"C:\Program Files\gcc.exe" -O2'
    for cc, command in ((path, (path,)), (spaced, (r"C:\Program Files\gcc.exe", "-O2"))):
        made = found(monkeypatch, command[0], GCC, windows=True, cc=cc)
        assert made.command == command
    assert found(monkeypatch, "my gcc", GCC, windows=False, cc=r"my\ gcc").command == ("my gcc",)


def test_microsofts_compiler_is_refused_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    for cc in ("cl", "cl.exe", "clang-cl"):
        with pytest.raises(CompilerError, match="MinGW's gcc does, or pip install ziglang"):
            found(monkeypatch, cc, GCC, windows=True, cc=cc)
    with pytest.raises(CompilerError, match=r"clang .takes other C"):
        found(monkeypatch, "clang", CLANG + "#define _MSC_VER 1940\n", windows=True)


def test_a_loaded_library_is_left_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Windows does not let it be replaced; another file of its name is an error."""
    source, target = tmp_path / "new", tmp_path / "old"

    def refuse(*paths: object) -> None:
        raise PermissionError(13, "in use")

    monkeypatch.setattr(os, "replace", refuse)
    source.write_bytes(b"kernel")
    target.write_bytes(b"kernel")
    cache._place(source, target)
    target.write_bytes(b"another")
    with pytest.raises(PermissionError):
        cache._place(source, target)
    assert target.read_bytes() == b"another"
