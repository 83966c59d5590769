"""Exact derivatives of efforts of least norm in the state, by tangents of their graph."""

from __future__ import annotations

from typing import Any

import numpy as np

from .model import Model

STATE = ("q", "q1", "q2")  # ports of a state


def effort_derivatives(
    model: Model, state: tuple[np.ndarray, ...], wrench: np.ndarray, at: Any
) -> np.ndarray:
    """d effort / d (q, q', q''), (N, n, 3 m), the load being constant in {S}.

    Args: state: q, q', q'', (N, m) each, of samples that are `ok`;  wrench: (N, 6), at `at`.
    """
    own = model._arguments
    _, ports = own.samples((own.q, own.v, own.a), state, wrench, at)
    return model.system.robust.derivative("inverse", STATE, "effort", ports)
