"""Gravity and the base's motion among the columns of a table."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, TypedDict, cast

import numpy as np

from ..errors import InputError, join
from .column_units import BASE, GRAVITY


class Given(TypedDict, total=False):
    """What models take beside states: gravity, (N, 3), and the base's motion, (N, 9)."""

    gravity: np.ndarray
    base: np.ndarray


def gravity_and_base_columns(names: Collection[str], source: str) -> tuple[str, ...]:
    """Names of the columns of gravity and of the base's motion, in order.

    Raises: InputError: for a part of gravity.
    """
    given = [name for name in GRAVITY if name in names]
    if 0 < len(given) < len(GRAVITY):
        missing = join([name for name in GRAVITY if name not in given])
        raise InputError(f"{source}: got {join(given)}; gravity also needs {missing}")
    return (*given, *(name for name in BASE if name in names))


def gravity_and_base_of(
    columns: Mapping[str, np.ndarray], rate: Callable[[str], np.ndarray] | None = None
) -> Given:
    """What there are columns of; the base's columns that are not there are zero.

    Args: rate: of the column of that name: the base's angular acceleration, if it is not given.
    """
    inputs: Given = {}
    if rate is not None and not {*BASE[6:]} & {*columns}:
        pairs = zip(BASE[3:6], BASE[6:], strict=True)
        columns = {**columns, **{d: rate(w) for w, d in pairs if w in columns}}
    if GRAVITY[0] in columns:
        inputs["gravity"] = np.column_stack([columns[name] for name in GRAVITY])
    if moving := [columns[name] for name in BASE if name in columns]:
        still = np.zeros_like(moving[0])
        inputs["base"] = np.column_stack([columns.get(name, still) for name in BASE])
    return inputs


def each(given: Given, take: Callable[[np.ndarray], np.ndarray]) -> Given:
    """The same with what is taken of each array."""
    found: Any = {name: take(np.asarray(a)) for name, a in given.items()}
    return cast(Given, found)
