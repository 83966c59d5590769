"""CasADi functions on arrays of samples."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

CHUNK = 256  # samples a call: many enough for calls to cost little, few enough to map quickly


def evaluate(function: ca.Function, *inputs: np.ndarray) -> list[np.ndarray]:
    """Outputs (N, size) of a function of vectors at N samples, matrices column by column.

    From memory to memory: as matrices of CasADi, samples cost more to copy than to compute.

    Args: inputs: (N, size) each, or (size,) where the same for every sample.
    """
    function = _dense(function)
    count = max(len(a) for a in inputs if a.ndim == 2)
    given = [np.ascontiguousarray(_samples(a, count), dtype=float) for a in inputs]
    outputs = [np.empty((count, function.numel_out(i))) for i in range(function.n_out())]
    for block, starts in _blocks(count):
        mapped: Any = function.map(block)
        buffer, run = mapped.buffer()
        for start in starts:
            for i, a in enumerate(given):
                buffer.set_arg(i, a[start : start + block].data)
            for i, a in enumerate(outputs):
                buffer.set_res(i, a[start : start + block].data)
            run()
    return outputs


def _blocks(count: int) -> list[tuple[int, range]]:
    """Samples a call, and where each call starts."""
    whole = count - count % CHUNK
    blocks = [(CHUNK, range(0, whole, CHUNK)), (count - whole, range(whole, count, CHUNK))]
    return [(block, starts) for block, starts in blocks if starts]


def _samples(a: np.ndarray, count: int) -> np.ndarray:
    return a if a.ndim == 2 else np.tile(a, (count, 1))


def _dense(function: ca.Function) -> ca.Function:
    """The function with every entry of its outputs stored."""
    if all(function.sparsity_out(i).is_dense() for i in range(function.n_out())):
        return function
    inputs = function.mx_in()
    outputs = function.call(inputs)
    return ca.Function(function.name(), inputs, [ca.densify(o) for o in outputs])
