"""The numbers that the page carries: named columns of samples, packed for a browser."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

BUDGET = 3_400_000  # bytes of samples, so that a page of 5001 samples stays under 10 MB


class Columns:
    """Samples by name, (N,) each, in the order they were added.

    Times travel as float64, values as float32: seven digits, more than any readout shows.
    """

    def __init__(self, time: np.ndarray) -> None:
        self.time = np.asarray(time, dtype=float)
        self._values: dict[str, np.ndarray] = {}

    def add(self, name: str, values: np.ndarray) -> int:
        """Number of the column `name`, which is added if it is new."""
        if name not in self._values:
            self._values[name] = np.asarray(values, dtype=float)
        return list(self._values).index(name)

    def add_vector(self, name: str, values: np.ndarray) -> list[int]:
        """Numbers of the columns of (N, m) values."""
        return [self.add(f"{name}.{i}", column) for i, column in enumerate(values.T)]

    def kept(self) -> np.ndarray:
        """Samples that the page keeps: all, or even steps and every column's extremes."""
        count = len(self.time)
        affordable = max(BUDGET // (4 * max(len(self._values), 1)), 2)
        if count <= affordable:
            return np.arange(count)
        extremes = {0, count - 1}
        for values in self._values.values():
            if np.isfinite(values).any():
                extremes |= {int(np.nanargmin(values)), int(np.nanargmax(values))}
        steps = np.arange(0, count, -(-count // max(affordable - len(extremes), 2)))
        return np.unique([*steps, *extremes])

    def packed(self) -> dict[str, Any]:
        """What the page's script unpacks."""
        kept = self.kept()
        values = np.array([column[kept] for column in self._values.values()], dtype="<f4")
        return {
            "samples": len(kept),
            "total": len(self.time),
            "time": _base64(self.time[kept].astype("<f8")),
            "names": list(self._values),
            "values": _base64(values),
        }


def _base64(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
