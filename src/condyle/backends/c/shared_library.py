"""Shared libraries: found in the cache or built, loaded; kernels get a mechanism's numbers."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from ...errors import UnsupportedError
from ...graph.program import Numbers
from .. import cache
from ..compiler import Compiler, CompilerError
from ..notice import notice

_doubles = ctypes.POINTER(ctypes.c_double)


def obtained(
    recipe: str, make: cache.Make, opened: Callable[[str], ctypes.CDLL]
) -> tuple[cache.CachedLibrary, ctypes.CDLL]:
    """The library of a recipe, built if need be, and opened.

    Raises: CompilerError: where it cannot be built, or opened once it is.
    """
    ways: tuple[Callable[[cache.CachedLibrary | None], cache.CachedLibrary | None], ...] = (
        lambda _: cache.find(recipe),
        lambda broken: cache.build(recipe, make, notice, broken),
        lambda _: cache.build_apart(recipe, make),
    )
    problem: Exception | None = None
    entry = None
    try:
        for way in ways:
            if (entry := way(entry)) is not None:
                try:
                    return entry, opened(str(entry.library))
                except OSError as error:  # built with another C library, or cleared just now
                    problem = error
    except (OSError, AttributeError, UnsupportedError) as error:
        problem = error
    raise CompilerError(f"no kernel could be built and loaded: {problem}") from problem


def tool(compiler: Compiler) -> str:
    """What of a compiler shapes its libraries."""
    return repr((compiler.command, compiler.single_flags, compiler.lanes, compiler.identity))


@lru_cache(maxsize=64)
def load(path: str) -> ctypes.CDLL:
    """A kernel, its functions typed.

    Raises: OSError, AttributeError: if it cannot be loaded, or is no kernel.
    """
    library = ctypes.CDLL(path)
    pointer, size, number = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
    library.batch_some.argtypes = [*[pointer] * 3, size, pointer, size, *[pointer] * 2, number]
    library.batch_some.restype = None
    library.prepare.argtypes, library.prepare.restype = [pointer] * 3, None
    if hasattr(library, "one"):
        library.one.argtypes = [pointer] * 3
    return library


def prepared(library: ctypes.CDLL, facts: Mapping[str, Any], numbers: Numbers) -> np.ndarray:
    """The table of what does not change from sample to sample, (table_size,), of one mechanism: the
    first."""
    table = aligned(facts["table_size"])
    blocks = [
        np.ascontiguousarray(padded(own[0], pad[0], facts["lanes"]))
        for own, pad in zip(numbers.lanes, numbers.padding, strict=True)
    ]
    pointers = (_doubles * len(blocks))(*(_pointer(block) for block in blocks))
    library.prepare(_pointer(numbers.parameters), pointers, _pointer(table))
    return table


def aligned(count: int) -> np.ndarray:
    """An array that starts on a cache line, as vector loads like it."""
    raw = np.empty(count + 8)
    offset = (-raw.ctypes.data // 8) % 8
    return raw[offset : offset + count]


def padded(own: np.ndarray, pad: np.ndarray, width: int) -> np.ndarray:
    """Constants (..., size, lanes), filled up to whole vectors by pad, (..., size)."""
    extra = -own.shape[-1] % width
    return np.concatenate([own, np.repeat(pad[..., None], extra, axis=-1)], axis=-1)


def _pointer(a: np.ndarray) -> Any:
    return a.ctypes.data_as(_doubles)
