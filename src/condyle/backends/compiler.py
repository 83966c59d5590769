"""The C compiler of this machine: how it is found, its version, and calls of it."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from ..errors import CondyleError

# Never -ffast-math: it undoes fused forms and breaks argument reduction in sine and cosine.
FLAGS = (
    "-O2",
    "-ffp-contract=fast",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-fPIC",
    "-shared",
)
# GCC alone takes it. Without it, it keeps scalars in integer registers when it runs out of others,
# on the ports that arithmetic needs.
GCC = "-mtune-ctrl=^inter_unit_moves_to_vec,^inter_unit_moves_from_vec"
# What is made for this processor: the first that the compiler takes.
NATIVE = (("-march=native", GCC), ("-march=native",), ("-mcpu=native",), ())
# On Windows, GCC keeps vectors of AVX where the stack is not aligned for them (its bug 54412).
WINDOWS = sys.platform == "win32"
NO_AVX = ("-mno-avx",)
# One evaluation stands in an order that GCC makes better; a batch, whose chains stand abreast, is
# the worse for it.
ORDERED = ("-fschedule-insns", "-fsched-pressure")
# Of Microsoft's compiler, and of clang in its place.
FOREIGN = "takes other C and other options; MinGW's gcc does, or pip install ziglang"
SECONDS = 300  # a build that takes longer has gone wrong
ASKING = 10  # seconds in which a compiler says what it is
REMEDY = "Install gcc or clang, name another compiler in CC, or take numpy (--backend numpy)"


class CompilerError(CondyleError):
    """No compiler, or one that could not build a kernel."""


@dataclass(frozen=True)
class Compiler:
    """A working compiler.

    command:  how it is called.
    flags:    what it is given.
    identity: its version and the processor features it compiles for.
    lanes:    doubles in a vector register of that processor.
    """

    command: tuple[str, ...]
    flags: tuple[str, ...]
    identity: str
    lanes: int

    @property
    def single_flags(self) -> tuple[str, ...]:
        """Its flags for kernels of one evaluation."""
        return (*self.flags, *(() if "__clang__" in self.identity else ORDERED))

    def compile(self, source: Path, target: Path, flags: tuple[str, ...]) -> None:
        """Compile C into an object file.

        Raises: CompilerError: with the first lines of what the compiler said.
        """
        own = [flag for flag in flags if flag != "-shared"]
        self._call([*own, "-c", str(source), "-o", str(target)])

    def build(self, library: Path, *sources: Path) -> None:
        """Make a shared library of C or of object files.

        Raises: CompilerError: with the first lines of what the compiler said.
                OSError: if the library cannot be looked at.
        """
        maths = () if WINDOWS else ("-lm",)  # there, it is in the C library
        self._call([*self.flags, *map(str, sources), "-o", str(library), *maths])
        if not library.exists():
            raise CompilerError(f"{shlex.join(self.command)} said nothing and built nothing")

    def _call(self, arguments: list[str]) -> None:
        try:
            done = _run([*self.command, *arguments], SECONDS)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise CompilerError(f"{self.command[0]} could not be run: {error}") from None
        if done.returncode:
            said = "\n".join((done.stderr or done.stdout).splitlines()[:5])
            why = said or f"exit status {done.returncode}"
            raise CompilerError(f"{shlex.join(self.command)} failed: {why}")


def find_compiler() -> Compiler:
    """The compiler of `CC`, else cc, gcc, clang, or the one of the `ziglang` package.

    Raises: CompilerError: if there is none that works.
    """
    names = ("CC", "PATH", "CONDYLE_LANES")
    found = _find(*(os.environ.get(name, "").strip() for name in names))
    if isinstance(found, str):
        raise CompilerError(found)
    return found


@lru_cache(maxsize=8)
def _find(cc: str, path: str, lanes: str) -> Compiler | str:
    """The compiler, or the reason why there is none: the search may take long."""
    try:
        return _search(cc, path, lanes)
    except CompilerError as error:
        return str(error)


def _search(cc: str, path: str, lanes: str) -> Compiler:
    tried = []
    for command in _candidates(cc):
        if Path(command[0]).stem.lower() in ("cl", "clang-cl"):
            tried.append(f"{command[0]} ({FOREIGN})")
            continue
        if shutil.which(command[0], path=path or None) is None:
            tried.append(f"{command[0]} (not found)")
            continue
        try:
            for native in NATIVE:
                macros = _macros(command, native)
                if macros is not None and WINDOWS and "__clang__" not in macros:
                    native = (*native, *NO_AVX)
                    macros = _macros(command, native)
                if macros is not None and "_MSC_VER" in macros:
                    tried.append(f"{shlex.join(command)} ({FOREIGN})")
                    break
                if macros is not None:
                    flags = [flag for flag in FLAGS if not (WINDOWS and flag == "-fPIC")]
                    return Compiler(command, (*flags, *native), macros, _lanes(lanes, macros))
            else:
                tried.append(f"{shlex.join(command)} (does not work)")
        except subprocess.TimeoutExpired:
            tried.append(f"{shlex.join(command)} (does not answer)")
    raise CompilerError(f"no C compiler: tried {', '.join(tried) or 'nothing'}")


def _candidates(cc: str) -> list[tuple[str, ...]]:
    if cc:
        words = shlex.shlex(cc, posix=True, punctuation_chars=False)
        words.whitespace_split, words.commenters = True, ""
        if WINDOWS:  # a path's backslashes stand for themselves
            words.escape = ""
        try:
            return [tuple(words)]
        except ValueError as error:
            raise CompilerError(f"CC is {cc!r}: {error}") from None
    found: list[tuple[str, ...]] = [("cc",), ("gcc",), ("clang",)]
    if find_spec("ziglang") is not None:
        found.append((sys.executable, "-m", "ziglang", "cc"))
    return found


def _macros(command: tuple[str, ...], native: tuple[str, ...]) -> str | None:
    """Everything the compiler defines for this processor: its version and instruction sets."""
    call = [*command, *native, "-dM", "-E", "-x", "c", "-"]
    try:
        done = _run(call, ASKING)
    except OSError:
        return None
    if done.returncode or "__VERSION__" not in done.stdout:
        return None
    where = shutil.which(command[0]) or command[0]
    return f"{where}\n{platform.machine()}\n{done.stdout}"


def _run(call: list[str], seconds: float) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        call,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=seconds,
        stdin=subprocess.DEVNULL,
    )


def _lanes(chosen: str, macros: str) -> int:
    if chosen:
        if chosen not in ("2", "4", "8"):
            raise CompilerError(f"CONDYLE_LANES is {chosen!r}; expected 2, 4 or 8")
        return int(chosen)
    if "__AVX512F__" in macros:
        return 8
    return 4 if "__AVX2__" in macros else 2
