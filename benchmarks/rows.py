"""Rows of the benchmark's table, timed side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from statistics import median, quantiles

TOLERANCE = 1e-9


@dataclass(frozen=True)
class Probe:
    """Something to time.

    run:        does some milliseconds of work; seconds an evaluation.
    error:      largest difference from numpy's torques, relative to the largest.
    tolerance:  of the error: more, and the time means nothing.
    operations: vector operations of a batch step, a fused multiply-add counting one.
    """

    name: str
    run: Callable[[], float]
    error: float
    operations: int | None = None
    note: str = ""
    tolerance: float = TOLERANCE


@dataclass
class Row:
    """One line of the table.

    seconds: median; `spread`: the width of its middle half; `times`: round by round.
    """

    name: str
    seconds: float
    spread: float
    error: float
    operations: int | None
    note: str = ""
    times: list[float] = field(default_factory=list, repr=False)

    def over(self, other: Row) -> float:
        """How many times longer this takes: the median over rounds, where both were timed in each.

        A machine that is slow for a while is slow for both.
        """
        if len(self.times) != len(other.times):
            return self.seconds / other.seconds
        return median(a / b for a, b in zip(self.times, other.times, strict=True))


def timed(
    probes: Sequence[Probe], rounds: int, begun: Callable[[int], None] = lambda _: None
) -> Iterator[Row]:
    """Rows of probes that are run in turn, round after round.

    Args: begun: told of each round that begins.
    """
    times: list[list[float]] = [[] for _ in probes]
    for number in range(rounds):
        begun(number)
        for probe, own in zip(probes, times, strict=True):
            probe.run()  # brings its code and data into the caches
            own.append(probe.run())
    for probe, own in zip(probes, times, strict=True):
        wrong = probe.error > probe.tolerance
        note = f"WRONG by {probe.error:.1e}; its time means nothing" if wrong else probe.note
        yield Row(probe.name, *spread(own), probe.error, probe.operations, note, own)


def spread(times: Sequence[float]) -> tuple[float, float]:
    """Median and interquartile range."""
    if len(times) < 3:
        return median(times), 0.0
    low, _, high = quantiles(times, n=4)
    return median(times), high - low
