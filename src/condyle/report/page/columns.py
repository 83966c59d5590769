"""The numbers that the page carries: named columns of samples, packed for a browser."""

from __future__ import annotations

from typing import Any

import numpy as np

from .encode import packed
from .envelope import Envelope


class Columns:
    """Samples by name, (N,) each, in the order they were added.

    Times travel as float64, values as float32: seven digits, more than any readout shows.
    """

    def __init__(self, time: np.ndarray) -> None:
        self.time = np.asarray(time, dtype=float)
        self.values: dict[str, np.ndarray] = {}
        self.lines: dict[str, int] = {}  # those that are drawn over time, with their numbers
        self._numbers: dict[str, int] = {}

    def add(self, name: str, values: np.ndarray) -> int:
        """Number of the column `name`, which is added if it is new."""
        if name not in self.values:
            self._numbers[name] = len(self.values)
            self.values[name] = np.asarray(values, dtype=float)
        return self._numbers[name]

    def add_line(self, name: str, values: np.ndarray) -> int:
        """As `add`, for a curve over time, whose peaks the page keeps however long the run is."""
        self.lines[name] = number = self.add(name, values)
        return number

    def add_vector(self, name: str, values: np.ndarray) -> list[int]:
        """Numbers of the columns of (N, m) values."""
        return [self.add(f"{name}.{i}", column) for i, column in enumerate(values.T)]

    def packed(self, total: int, envelope: Envelope | None = None) -> dict[str, Any]:
        """What the page's script unpacks.

        Args: total: samples of the run;  envelope: of the lines, if the page has fewer.
        """
        values = np.array(list(self.values.values()), dtype="<f4")
        return {
            "samples": len(self.time),
            "total": total,
            "time": packed(self.time, "<f8"),
            "names": list(self.values),
            "values": packed(values, "<f4"),
            "envelope": None if envelope is None else envelope.packed(self.lines),
        }
