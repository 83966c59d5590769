"""C++ compilers for the compiled peers, and the flags at which each is at its best.

Measured on the cut tree with Pinocchio 4.1, gcc 12 and clang 19: plain `-O3 -march=native` takes
3.0 and 2.1 us. Three-vectors written by halves and read whole stall the processor, so packing them
into registers is switched off, in Eigen and in the compiler; whole registers of chains stay.
Then small functions inlined: 1.7 and 1.5 us.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

from .base import PeerError

COMMON = (
    "-std=c++17",
    "-O3",
    "-march=native",
    "-DNDEBUG",
    "-fno-math-errno",
    "-DEIGEN_UNALIGNED_VECTORIZE=0",
)
TUNED = {
    "gcc": (
        "-fno-tree-slp-vectorize",
        "--param=inline-unit-growth=200",
        "--param=max-inline-insns-auto=300",
        "--param=max-inline-insns-single=1000",
        "--param=large-function-growth=1000",
    ),
    "clang": ("-fno-slp-vectorize", "-ffp-contract=fast", "-mllvm", "-inline-threshold=2000"),
}
SHARED = ("-shared", "-fPIC", "-fvisibility=hidden", "-fvisibility-inlines-hidden", "-w")
HINT = {
    "gcc": "no g++ found: install gcc with C++",
    "clang": "no clang++ found: install clang, or pip install ziglang",
}


def command(family: str) -> list[str] | None:
    """The command that starts a compiler of a family, "gcc" or "clang"; None if there is none."""
    if family == "gcc":
        return [path] if (path := shutil.which("g++")) else None
    for name in ("clang++", *(f"clang++-{number}" for number in range(30, 13, -1))):
        if path := shutil.which(name):
            return [path]
    return [sys.executable, "-m", "ziglang", "c++"] if importlib.util.find_spec("ziglang") else None


def build(
    family: str, source: Path, options: list[str], versions: str, workdir: Path
) -> tuple[Path, list[str]]:
    """Shared library made from one source file, or found made from the same; and its flags.

    Args: versions: of the libraries whose headers it includes.

    Raises: PeerError: with the end of what the compiler said.
    """
    compiler = command(family)
    if compiler is None:
        raise PeerError(HINT[family])
    flags = [*COMMON, *TUNED[family]]
    texts = [p.read_text() for p in (source, *sorted(source.parent.glob("*.hpp")))]
    identity = [version(family), _processor(), *flags, *SHARED, *options, versions, *texts]
    key = hashlib.sha256("\0".join(identity).encode()).hexdigest()[:16]
    library = workdir / f"{source.stem}-{family}-{key}.so"
    if not library.exists():
        part = library.with_suffix(f".{os.getpid()}.part")
        line = [*compiler, *flags, *SHARED, str(source), "-o", str(part), *options]
        done = subprocess.run(line, capture_output=True, text=True)
        if done.returncode:
            raise PeerError(f"{source.name} does not compile: {done.stderr.strip()[-400:]}")
        part.replace(library)
    return library, flags


def version(family: str) -> str:
    """First line of the compiler's own account of itself."""
    line = [*(command(family) or []), "--version"]
    return subprocess.run(line, capture_output=True, text=True).stdout.partition("\n")[0]


def _processor() -> str:
    """What `-march=native` depends on."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return "\n".join(x for x in lines if x.startswith(("model name", "flags")))
