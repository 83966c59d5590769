"""Checks that all sampled input shares."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InputError


def as_samples(values: Any, name: str, source: str, size: int | None = None) -> np.ndarray:
    """`values` as finite floats, (size,).

    Raises: InputError: for anything else, with the sample at fault.
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f'{source}: "{name}" is not a series of numbers ({error})') from error
    if array.ndim != 1 or (size is not None and len(array) != size):
        expected = "(samples,)" if size is None else f"({size},), as t has"
        raise InputError(f'{source}: "{name}" has shape {array.shape}, expected {expected}')
    bad = np.flatnonzero(~np.isfinite(array))
    if len(bad):
        i = bad[0]
        raise InputError(f'{source}, sample {i}: "{name}" is {array[i]}, expected a finite number')
    return array


def check_rising(t: np.ndarray, where: Callable[[int], str]) -> None:
    """Raise an InputError at the first time that is not later than the one before."""
    falls = np.flatnonzero(np.diff(t) <= 0)
    if len(falls):
        i = int(falls[0]) + 1
        before, now = float(t[i - 1]), float(t[i])
        raise InputError(
            f"{where(i)}: t is {now} s after {before} s; times must rise from row to row"
        )


def runs_of(flag: np.ndarray) -> list[slice]:
    """Where an array of truths, (N,), is true, stretch by stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flag.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
