"""CasADi functions on arrays of samples."""

from __future__ import annotations

import casadi as ca
import numpy as np


def evaluate(function: ca.Function, *inputs: np.ndarray) -> list[np.ndarray]:
    """Outputs (N, size) of a function of vectors at N samples, matrices column by column.

    Args: inputs: (N, size) each, or (size,) where the same for every sample.
    """
    count = max(len(a) for a in inputs if a.ndim == 2)
    sizes = [function.numel_out(i) for i in range(function.n_out())]
    if not count:
        return [np.empty((0, size)) for size in sizes]
    given = [ca.DM(np.broadcast_to(a, (count, a.shape[-1])).T) for a in inputs]
    found = function.map(count).call(given)
    return [a.full().T.reshape(count, size) for a, size in zip(found, sizes, strict=True)]
