"""The numbers that the page carries: named columns of samples, packed for a browser."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from typing import Any

import numpy as np


def packed(values: Any, kind: str) -> str:
    """An array in base64, of numpy's type `kind`."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


@dataclass
class Envelope:
    """Smallest and largest value of curves in spans of time, and when.

    edges: of the spans, (B + 1,) [s].   spans: (4, B) by name: low, high, and where each is in its
    span, from 0 to 1.
    """

    edges: np.ndarray
    spans: dict[str, np.ndarray] = field(default_factory=dict)

    def packed(self, lines: dict[str, int]) -> dict[str, Any]:
        """The curves `lines`, name -> number of its column."""
        low, high, low_at, high_at = np.array([self.spans[name] for name in lines]).swapaxes(0, 1)
        return {
            "columns": list(lines.values()),
            "edges": packed(self.edges, "<f8"),
            "low": packed(low, "<f4"),
            "high": packed(high, "<f4"),
            "lowAt": packed(np.round(65535 * low_at), "<u2"),
            "highAt": packed(np.round(65535 * high_at), "<u2"),
        }


class Columns:
    """Samples by name, (N,) each, in the order they were added.

    Times travel as float64, values as float32: seven digits, more than any readout shows.
    """

    def __init__(self, time: np.ndarray) -> None:
        self.time = np.asarray(time, dtype=float)
        self.values: dict[str, np.ndarray] = {}
        self.lines: dict[str, int] = {}  # of curves, whose peaks the page keeps in any long run

    def add(self, name: str, values: np.ndarray, line: bool = False) -> int:
        """Number of the column `name`, which is added if it is new."""
        self.values.setdefault(name, np.asarray(values, dtype=float))
        number = list(self.values).index(name)
        if line:
            self.lines[name] = number
        return number

    def add_vector(self, name: str, values: np.ndarray) -> list[int]:
        """Numbers of the columns of (N, m) values."""
        return [self.add(f"{name}.{i}", column) for i, column in enumerate(values.T)]

    def packed(self, total: int, envelope: Envelope | None = None) -> dict[str, Any]:
        """What the page's script unpacks.

        Args: total: samples of the run;  envelope: of the lines, if the page has fewer.
        """
        return {
            "samples": len(self.time),
            "total": total,
            "time": packed(self.time, "<f8"),
            "names": list(self.values),
            "values": packed(list(self.values.values()), "<f4"),
            "envelope": None if envelope is None else envelope.packed(self.lines),
        }
