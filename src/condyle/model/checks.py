"""What is given to a model: is it an array of the right shape, and if not, what would be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..mechanism.mechanism import COORDINATES

POSE_COLUMNS = f"{', '.join(COORDINATES)} [m, rad]"
LOAD_COLUMNS = (
    "Fx, Fy, Fz [N], Mx, My, Mz [N m] in {S}, and the point they act at, x, y, z [m] in {M}"
)


def check_array(name: str, given: Any, count: int, columns: str) -> None:
    """Raises InputError for what is no array (N, count) of those columns."""
    if np.ndim(given) != 2 or np.shape(given)[1] != count:
        raise InputError(
            f"{name}: expected an array of shape (N, {count}), with columns {columns}; got "
            f"{_described(given)}. One sample is an array of one row"
        )


def check_states(independent: Sequence[str], *states: Any) -> None:
    """Raises InputError for arrays that are not q, q' and q'' of the independent coordinates."""
    for name, given in zip(("q", "q'", "q''"), states, strict=False):
        check_array(name, given, len(independent), f"{', '.join(independent)} [m, rad]")


def _described(given: Any) -> str:
    if isinstance(given, np.ndarray | list | tuple):
        return f"shape {np.shape(given)}"
    return f"{type(given).__name__} {given!r:.60}"
