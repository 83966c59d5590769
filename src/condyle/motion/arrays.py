"""Checks that all sampled input shares."""

from __future__ import annotations

import math
from collections.abc import Callable
from numbers import Real
from typing import Any

import numpy as np

from ..errors import InputError, shown


def as_number(
    given: Any, name: str, expected: str, accept: Callable[[float], bool] = math.isfinite
) -> float:
    """`given` as a finite float that `accept` takes; `expected` says which.

    Raises: InputError: for anything else.
    """
    if isinstance(given, Real) and not isinstance(given, bool):
        try:
            if math.isfinite(value := float(given)) and accept(value):
                return value
        except OverflowError:
            pass
    raise InputError(f"{name}: expected {expected}, got {shown(given)}")


def as_text(given: Any, name: str, expected: str) -> str | None:
    """`given` where it is a text or None.

    Raises: InputError: for anything else.
    """
    if given is None or isinstance(given, str):
        return given
    raise InputError(f"{name}: expected {expected}, got {shown(given)}")


def as_samples(values: Any, name: str, source: str, size: int | None = None) -> np.ndarray:
    """`values` as finite floats, (size,).

    Raises: InputError: for anything else, with the sample at fault.
    """
    array = as_doubles(values, f'{source}: "{name}"')
    if array.ndim != 1 or (size is not None and len(array) != size):
        expected = "(samples,)" if size is None else f"({size},), as t has"
        raise InputError(f'{source}: "{name}" has shape {array.shape}, expected {expected}')
    bad = np.flatnonzero(~np.isfinite(array))
    if len(bad):
        i = bad[0]
        raise InputError(f'{source}, sample {i}: "{name}" is {array[i]}, expected a finite number')
    return array


def as_doubles(values: Any, name: str) -> np.ndarray:
    """`values` as an array of doubles, a new one.

    Raises: InputError: for anything but real numbers.
    """
    try:
        array = np.array(values)
        if array.dtype.kind in "fiubO" and not (array.dtype == object and None in array.ravel()):
            return array.astype(float)
    except (TypeError, ValueError, OverflowError):  # ragged lists, objects, huge integers
        pass
    raise InputError(f"{name}: expected an array of numbers, got {shown(values)}")


def check_rising(t: np.ndarray, where: Callable[[int], str]) -> None:
    """Raise an InputError at the first time that is not later than the one before."""
    falls = np.flatnonzero(np.diff(t) <= 0)
    if len(falls):
        i = int(falls[0]) + 1
        before, now = float(t[i - 1]), float(t[i])
        raise InputError(
            f"{where(i)}: t is {now} s after {before} s; times must be strictly increasing"
        )


def runs_of(flag: np.ndarray) -> list[slice]:
    """Where an array of truths, (N,), is true, stretch by stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flag.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
