"""A row of the benchmark's table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median, quantiles


@dataclass
class Row:
    """One measurement.

    seconds:    median; `spread`: the width of its middle half.
    error:      largest difference from the interpreter's torques, relative to the largest.
    operations: vector operations of a batch step, a fused multiply-add counting one.
    """

    name: str
    seconds: float
    spread: float
    error: float
    operations: int | None
    note: str = ""


def spread(times: Sequence[float]) -> tuple[float, float]:
    """Median and interquartile range."""
    if len(times) < 3:
        return median(times), 0.0
    low, _, high = quantiles(times, n=4)
    return median(times), high - low
