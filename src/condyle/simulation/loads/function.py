"""A load that is a function in Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError
from .base import BoundLoad


@dataclass(frozen=True)
class BoundFunction(BoundLoad):
    """function: (t, s, v) -> force (3,) [N], or force and moment (6,), at the point, in {S}."""

    function: Callable[..., Any] = print

    def law(self, t: float, s: Sequence[float], v: Sequence[float], mode: int) -> tuple[float, ...]:
        found = np.asarray(self.function(t, np.array(s), np.array(v)), dtype=float).ravel()
        if found.shape not in ((3,), (6,)) or not np.isfinite(found).all():
            raise InputError(
                f'load "{self.name}": at t = {t:g} s its function returned {found!s:.80}; expected '
                "a force (3,) [N], or a force and a moment (6,) [N, N m], finite"
            )
        return tuple(found.tolist())
