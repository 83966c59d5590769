"""What is given to a model: is it an array of the right shape, and if not, what would be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..mechanism.mechanism import COORDINATES

POSE_COLUMNS = f"{', '.join(COORDINATES)} [m, rad]"
LOAD_COLUMNS = (
    "Fx, Fy, Fz [N], Mx, My, Mz [N m] in {S}, and the point they act at, x, y, z [m] in {M}"
)


class Sample(NamedTuple):
    """An array of one sample, (length,): its name, and its columns in words."""

    name: str
    length: int
    columns: str


LOAD = Sample("load", 9, LOAD_COLUMNS)


def samples_of_states(independent: Sequence[str]) -> tuple[Sample, Sample, Sample]:
    """Of q, q' and q'' of the independent coordinates."""
    columns = f"{', '.join(independent)} [m, rad]"
    q, q1, q2 = (Sample(name, len(independent), columns) for name in ("q", "q'", "q''"))
    return q, q1, q2


def check_array(name: str, given: Any, count: int, columns: str) -> None:
    """Raises InputError for what is no array (N, count) of those columns."""
    if np.ndim(given) != 2 or np.shape(given)[1] != count:
        raise InputError(
            f"{name}: expected an array of shape (N, {count}), with columns {columns}; got "
            f"{_described(given)}. One sample is an array of one row"
        )


def check_states(independent: Sequence[str], *states: Any) -> None:
    """Raises InputError for arrays that are not q, q' and q'' of the independent coordinates."""
    for (name, count, columns), given in zip(samples_of_states(independent), states, strict=False):
        check_array(name, given, count, columns)


def ports_of_load(load: Any) -> dict[str, np.ndarray]:
    """Loads as questions take them.

    Raises: InputError: for what is no array (N, 9).
    """
    check_array("load", load, 9, LOAD_COLUMNS)
    load = np.asarray(load)
    return {"force": load[:, :3], "moment": load[:, 3:6], "point": load[:, 6:]}


def as_samples(wanted: Sequence[Sample], *given: Any) -> list[np.ndarray]:
    """Arrays of one sample, as doubles.

    Raises: InputError: for what is no array of the right length.
    """
    return [_as_sample(sample, a) for sample, a in zip(wanted, given, strict=True)]


def _as_sample(wanted: Sample, given: Any) -> np.ndarray:
    name, length, columns = wanted
    try:
        found = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        kind = type(given).__name__
        raise InputError(f"{name}: expected numbers, got {kind} {given!r:.60}") from None
    if found.shape != (length,):
        raise InputError(
            f"{name}: expected one sample, an array of shape ({length},), with columns {columns}; "
            f"got {_described(given)}"
        ) from None
    return found


def _described(given: Any) -> str:
    if isinstance(given, np.ndarray | list | tuple):
        return f"shape {np.shape(given)}"
    return f"{type(given).__name__} {given!r:.60}"
