"""A controller that is a function in Python."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError
from .base import Law, Measured, Memory, Reference


@dataclass(frozen=True)
class FunctionLaw(Law):
    """function: (measured, reference) -> efforts (n,) [N m or N]."""

    function: Callable[[Measured, Reference], Any]

    def __call__(self, now: Measured, aim: Reference, memory: Memory) -> tuple[np.ndarray, Memory]:
        effort = np.asarray(self.function(now, aim), dtype=float)
        n = len(self.model.mechanism.chains)
        if effort.shape != (n,) or not np.isfinite(effort).all():
            raise InputError(
                f"the controller returned {effort!s:.80} at t = {now.t:g} s; expected efforts of "
                f"shape ({n},), one a chain, finite"
            )
        return effort, memory
