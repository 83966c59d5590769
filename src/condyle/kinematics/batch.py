"""CasADi functions on arrays of samples."""

from __future__ import annotations

import casadi as ca
import numpy as np

CHUNK = 8192  # samples a call: keeps CasADi's copies small


def evaluate(function: ca.Function, *inputs: np.ndarray) -> list[np.ndarray]:
    """Outputs (N, size) of a function of vectors at N samples.

    Args: inputs: (N, size) each, or (size,) where the same for every sample.
    """
    count = max(len(a) for a in inputs if a.ndim == 2)
    pieces = []
    for start in range(0, count, CHUNK):
        end = min(start + CHUNK, count)
        columns = [a[start:end].T if a.ndim == 2 else _repeated(a, end - start) for a in inputs]
        result = function(*columns)
        outputs = result if isinstance(result, tuple) else (result,)
        pieces.append([_samples(o, end - start) for o in outputs])
    if not pieces:
        return [np.zeros((0, function.numel_out(i))) for i in range(function.n_out())]
    return [np.concatenate(parts) for parts in zip(*pieces, strict=True)]


def _repeated(a: np.ndarray, count: int) -> np.ndarray:
    return np.repeat(a[:, None], count, axis=1)


def _samples(output: ca.DM, count: int) -> np.ndarray:
    """(rows, columns * N) as CasADi maps it, to (N, rows * columns) column by column."""
    dense = np.asarray(ca.densify(output).full())
    return dense.T.reshape(count, -1) if dense.size else np.zeros((count, 0))
