"""Curves over more samples than the page has: their smallest and largest values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .encode import packed


@dataclass
class Envelope:
    """Smallest and largest value of curves in spans of time, and when.

    edges: of the spans, (B + 1,) [s].   low, high: (B,) by name.
    low_at, high_at: where in its span, (B,) from 0 to 1 by name.
    """

    edges: np.ndarray
    low: dict[str, np.ndarray] = field(default_factory=dict)
    high: dict[str, np.ndarray] = field(default_factory=dict)
    low_at: dict[str, np.ndarray] = field(default_factory=dict)
    high_at: dict[str, np.ndarray] = field(default_factory=dict)

    def packed(self, lines: Mapping[str, int]) -> dict[str, Any]:
        """The curves `lines`, name -> number of its column."""

        def rows(of: dict[str, np.ndarray]) -> np.ndarray:
            return np.array([of[name] for name in lines])

        return {
            "columns": list(lines.values()),
            "edges": packed(self.edges, "<f8"),
            "low": packed(rows(self.low), "<f4"),
            "high": packed(rows(self.high), "<f4"),
            "lowAt": packed(np.round(65535 * rows(self.low_at)), "<u2"),
            "highAt": packed(np.round(65535 * rows(self.high_at)), "<u2"),
        }
