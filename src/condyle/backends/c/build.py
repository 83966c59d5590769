"""Kernels found in the cache, or built: one evaluation and the batch side by side.

Which compiler's batch is quickest differs from processor to processor, so it is measured.
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

SAMPLES, ROUNDS = 512, 15  # of a measurement, which takes a millisecond


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
    sources = sorted(path for path in room.iterdir() if path.suffix in (".py", ".h"))
    return cache.digest(*(path.read_bytes() for path in [*sources, room.parent / "compiler.py"]))


def _make(
    folder: Path, variants: Variants, compilers: tuple[Compiler, ...], numbers: Numbers
) -> tuple[Path, dict[str, Any]]:
    with step("building a kernel"):
        source = emit(variants, compilers[0].lanes)
        libraries = _built(folder, source, compilers)
    facts: dict[str, Any] = {
        "graph": variants.digest,
        "interface": source.interface.data(),
        "checks": source.checks,
        "table_size": source.table_size,
        "operations": source.operations,
        "lanes": compilers[0].lanes,
        "flags": list(compilers[0].flags),
    }
    times = [0.0] if len(libraries) == 1 else _quickest(libraries, source, facts, numbers)
    best = int(np.argmin(times))
    chosen, library = compilers[best], libraries[best]
    assert library is not None
    load(str(library))  # only what can be loaded is kept
    facts |= {"compiler": list(chosen.command), "batch_flags": list(chosen.batch_flags)}
    if len(libraries) > 1:
        each = zip(compilers, times, strict=True)
        facts["nanoseconds"] = {c.command[0]: round(t, 2) for c, t in each if np.isfinite(t)}
    return library, facts


def _built(folder: Path, source: Source, compilers: tuple[Compiler, ...]) -> list[Path | None]:
    """The library with each compiler's batch; None where a rival of the first cannot build it."""
    first = compilers[0]
    single = folder / "single.c"
    with ThreadPoolExecutor() as pool:
        jobs = []
        if source.single is not None:
            single.write_text(source.single, encoding="utf-8")
            jobs.append(pool.submit(first.compile, single, folder / "single.o", first.flags))
        batches = []
        for i, compiler in enumerate(compilers):
            text, target = folder / f"batch{i}.c", folder / f"batch{i}.o"
            text.write_text(source.batch(compiler.abreast), encoding="utf-8")
            batches.append(pool.submit(compiler.compile, text, target, compiler.batch_flags))
        for job in (*jobs, batches[0]):
            job.result()
        done = [batch.exception() is None for batch in batches]
    shared = [folder / "single.o"] if source.single is not None else []
    libraries: list[Path | None] = []
    for i, whole in enumerate(done):
        library = folder / f"kernel{i}.so"
        if whole:
            first.build(library, folder / f"batch{i}.o", *shared)
        libraries.append(library if whole else None)
    return libraries


def _quickest(
    libraries: list[Path | None], source: Source, facts: dict[str, Any], numbers: Numbers
) -> list[float]:
    """What a sample takes in each library's batch, at home [ns]: the least of rounds in turn."""
    inputs = np.zeros(max(source.interface.columns, 1))
    at = inputs.ctypes.data
    columns = (ctypes.c_void_p * len(inputs))(*range(at, at + 8 * len(inputs), 8))
    strides = (ctypes.c_ssize_t * len(inputs))()  # each column is one constant
    rows = sum(source.interface.width(r) for r in source.interface.results)
    out, status = aligned(rows * SAMPLES), np.empty(SAMPLES, dtype=np.uint8)
    whole = [None if path is None else load(str(path)) for path in libraries]
    tables = [None if lib is None else prepared(lib, facts, numbers) for lib in whole]
    found = [np.inf] * len(whole)
    for _ in range(ROUNDS):
        for i, (library, table) in enumerate(zip(whole, tables, strict=True)):
            if library is None or table is None:
                continue
            start = time.perf_counter()
            library.batch(
                table.ctypes.data,
                ctypes.addressof(columns),
                ctypes.addressof(strides),
                SAMPLES,
                out.ctypes.data,
                SAMPLES,
                status.ctypes.data,
            )
            found[i] = min(found[i], (time.perf_counter() - start) / SAMPLES * 1e9)
    return found
