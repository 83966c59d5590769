"""Kernels found in the cache, or built: one evaluation and the batch side by side.

Which compiler is best at one evaluation differs from processor to processor, so it is measured.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ...graph.program import Numbers, Variants
from ...progress import step
from .. import cache
from ..compiler import Compiler, find_compiler, rivals
from .emit import Source, emit
from .library import aligned, load, obtained, prepared, tool

TIMES, ROUNDS = 256, 30  # evaluations, and rounds of them, of a measurement: a millisecond


def loaded(
    key: str, build: Callable[[], Variants], numbers: Numbers
) -> tuple[cache.Entry, ctypes.CDLL]:
    """The kernel of a question, built if need be.

    Args:   key: of everything that shapes what `build` returns;  numbers: to measure it by.
    Raises: CompilerError: where it cannot be built, or loaded once it is.
    """
    compilers = rivals(find_compiler())
    recipe = _recipe(key, *compilers)

    def make(folder: Path) -> tuple[Path, dict[str, Any]]:
        return _make(folder, build(), compilers, numbers)

    return obtained(recipe, make, load)


def _recipe(key: str, *compilers: Compiler) -> str:
    """Name of everything that shapes a kernel."""
    return cache.digest(key, _generator(), *map(tool, compilers))


@lru_cache(maxsize=1)
def _generator() -> str:
    """A hash of the code that turns graphs into C, and C into libraries."""
    room = Path(str(files(__package__)))
    both = (path for own in (room, room.parent / "x86") for path in own.iterdir())
    sources = sorted(path for path in both if path.suffix in (".py", ".h"))
    return cache.digest(*(path.read_bytes() for path in [*sources, room.parent / "compiler.py"]))


def _make(
    folder: Path, variants: Variants, compilers: tuple[Compiler, ...], numbers: Numbers
) -> tuple[Path, dict[str, Any]]:
    with step("building a kernel"):
        source = emit(variants, compilers[0].lanes, compilers[0].assembly)
        libraries = _built(folder, source, compilers)
    facts: dict[str, Any] = {
        "graph": variants.digest,
        "interface": source.interface.data(),
        "checks": source.checks,
        "table_size": source.table_size,
        "operations": source.operations,
        "lanes": compilers[0].lanes,
    }
    times = [0.0] if len(libraries) == 1 else _times(libraries, source, facts, numbers)
    best = int(np.argmin(times))
    chosen, library = compilers[best], libraries[best]
    assert library is not None
    load(str(library))  # only what can be loaded is kept
    facts |= {"compiler": list(chosen.command), "flags": list(chosen.single_flags)}
    if len(libraries) > 1:
        each = zip(compilers, times, strict=True)
        facts["nanoseconds"] = {c.command[0]: round(t, 2) for c, t in each if np.isfinite(t)}
    return library, facts


def _built(folder: Path, source: Source, compilers: tuple[Compiler, ...]) -> list[Path | None]:
    """The library with each compiler's evaluation of one sample; None where a rival of the first
    cannot build it."""
    first = compilers[0]
    text, batch = folder / "batch.c", folder / "batch.o"
    with ThreadPoolExecutor() as pool:
        singles = []
        if source.single is not None:
            single = folder / "single.c"
            single.write_text(source.single, encoding="utf-8")
            for i, c in enumerate(compilers):
                target = folder / f"single{i}.o"
                singles.append(pool.submit(c.compile, single, target, c.single_flags))
        text.write_text(source.batch(), encoding="utf-8")
        first.compile(text, batch, first.flags)
        for job in singles[:1]:
            job.result()
        done = [job.exception() is None for job in singles]
    if not singles:
        first.build(folder / "kernel.so", batch)
        return [folder / "kernel.so"]
    libraries: list[Path | None] = []
    for i, whole in enumerate(done):
        library = folder / f"kernel{i}.so"
        if whole:
            first.build(library, batch, folder / f"single{i}.o")
        libraries.append(library if whole else None)
    return libraries


def _times(
    libraries: list[Path | None], source: Source, facts: dict[str, Any], numbers: Numbers
) -> list[float]:
    """What one evaluation takes in each library, at home [ns]: the least of rounds in turn."""
    given = aligned(source.interface.columns + facts["lanes"])
    given[:] = 0.0
    rows = sum(source.interface.width(r) for r in source.interface.results)
    out = aligned(rows + source.checks)
    whole = [None if path is None else load(str(path)) for path in libraries]
    tables = [None if lib is None else prepared(lib, facts, numbers) for lib in whole]
    found = [np.inf] * len(whole)
    for _ in range(ROUNDS):
        for i, (library, table) in enumerate(zip(whole, tables, strict=True)):
            if library is None or table is None:
                continue
            start = time.perf_counter()
            library.repeat(table.ctypes.data, given.ctypes.data, out.ctypes.data, TIMES)
            found[i] = min(found[i], (time.perf_counter() - start) / TIMES * 1e9)
    return found
