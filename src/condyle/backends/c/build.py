"""Kernels found in the cache, or built: one evaluation and the batch side by side."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from ...graph.program import Variants
from ...progress import step
from .. import cache
from ..compiler import Compiler, find_compiler
from .emit import emit
from .shared_library import load, obtained, tool

Check = Callable[[ctypes.CDLL, dict[str, Any], Variants], None]


def loaded(
    key: str, build: Callable[[], Variants], check: Check
) -> tuple[cache.Entry, ctypes.CDLL]:
    """The kernel of a question, built if need be.

    Args:   key: of everything that shapes what `build` returns.
            check: raises CompilerError for a kernel, just built, that is not what was asked for.
    Raises: CompilerError: where it cannot be built, or loaded once it is.
    """
    compiler = find_compiler()
    recipe = _recipe(key, compiler)
    return obtained(recipe, lambda folder: _make(folder, build(), compiler, check), load)


def _recipe(key: str, compiler: Compiler) -> str:
    """Name of everything that shapes a kernel."""
    return cache.digest(key, _generator(), tool(compiler))


@lru_cache(maxsize=1)
def _generator() -> str:
    """A hash of the code that turns graphs into C, and C into libraries."""
    room = Path(str(files(__package__)))
    sources = sorted(path for path in room.iterdir() if path.suffix in (".py", ".h"))
    return cache.digest(*(path.read_bytes() for path in [*sources, room.parent / "compiler.py"]))


def _make(
    folder: Path, variants: Variants, compiler: Compiler, check: Check
) -> tuple[Path, dict[str, Any]]:
    library = folder / "kernel.so"
    with step("building a kernel"):
        source = emit(variants, compiler.lanes)
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
    facts = {
        "graph": variants.digest,
        "interface": source.interface.data(),
        "checks": source.checks,
        "table_size": source.table_size,
        "operations": source.operations,
        "lanes": compiler.lanes,
        "compiler": list(compiler.command),
        "flags": list(compiler.single_flags),
    }
    check(load(str(library)), facts, variants)  # only what can be loaded, and is right, is kept
    return library, facts
