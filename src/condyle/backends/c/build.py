"""Kernels found in the cache, or built: one evaluation and the batch side by side."""

from __future__ import annotations

import ctypes
import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from ...graph.program import Programs
from ...progress import step
from .. import cache
from ..compiler import Compiler, find_compiler
from .emit import Source, emit
from .shared_library import load, obtained, tool

Check = Callable[[ctypes.CDLL, dict[str, Any], Programs], None]


def loaded(
    key: str | None, build: Callable[[], Programs], check: Check
) -> tuple[cache.CachedLibrary, ctypes.CDLL]:
    """The kernel of a question, built if need be.

    A kernel's recipe is its C with the facts that go with it and the compiler: what changes no code
    builds nothing. The index leads there without deriving the equations.

    Args:   key: of everything that shapes what `build` returns; None: only its code says what that
            is, since something in it is not of this package.
            check: raises CompilerError for a kernel, just built, that is not what was asked for.
    Raises: CompilerError: where it cannot be built, or loaded once it is.
    """
    compiler = find_compiler()
    quick = None if key is None else _index_key(key, compiler)
    if quick is not None and (recipe := cache.indexed(quick)) is not None:
        entry = cache.find(recipe)
        with suppress(OSError, AttributeError):  # cleared just now, or of another C library
            if entry is not None:
                return entry, load(str(entry.library))
    variants = build()
    source = emit(variants, compiler.lanes)
    facts = _facts(source, variants, compiler)
    about = json.dumps(facts, sort_keys=True)
    recipe = cache.digest(source.batch, source.single or "", about, tool(compiler))
    library = obtained(
        recipe, lambda folder: _make(folder, source, facts, variants, compiler, check), load
    )
    if quick is not None:
        cache.index(quick, recipe)
    return library


def _index_key(key: str, compiler: Compiler) -> str:
    """A digest of all that may shape a kernel, known without deriving the equations."""
    return cache.digest(key, _generator(), tool(compiler))


@lru_cache(maxsize=1)
def _generator() -> str:
    """A hash of the code that turns graphs into C, and C into libraries."""
    room = Path(str(files(__package__)))
    sources = sorted(path for path in room.iterdir() if path.suffix in (".py", ".h"))
    return cache.digest(*(path.read_bytes() for path in [*sources, room.parent / "compiler.py"]))


def _facts(source: Source, variants: Programs, compiler: Compiler) -> dict[str, Any]:
    """What a caller must know of a kernel."""
    return {
        "graph": variants.digest,
        "interface": source.interface.data(),
        "checks": source.checks,
        "table_size": source.table_size,
        "operations": source.operations,
        "lanes": compiler.lanes,
        "compiler": list(compiler.command),
        "flags": list(compiler.single_flags),
    }


def _make(
    folder: Path,
    source: Source,
    facts: dict[str, Any],
    variants: Programs,
    compiler: Compiler,
    check: Check,
) -> tuple[Path, dict[str, Any]]:
    library = folder / "kernel.so"
    with step("building a kernel"):
        texts = {"batch": (source.batch, compiler.flags)}
        if source.single is not None:
            texts["single"] = source.single, compiler.single_flags
        with ThreadPoolExecutor() as pool:
            jobs = []
            for name, (text, flags) in texts.items():
                path = folder / f"{name}.c"
                path.write_text(text, encoding="utf-8")
                target = path.with_suffix(".o")
                jobs.append(pool.submit(compiler.compile, path, target, flags))
            for job in jobs:
                job.result()
        compiler.build(library, *(folder / f"{name}.o" for name in texts))
    facts = dict(facts)
    check(load(str(library)), facts, variants)  # only what can be loaded, and is right, is kept
    return library, facts
