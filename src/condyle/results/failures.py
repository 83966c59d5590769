"""When and why samples failed: intervals of one status and one cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kinematics.causes import cause_text, owners
from ..mechanism.mechanism import Mechanism
from ..status import STATUS_NAMES, Status

if TYPE_CHECKING:
    from .solution import Solution


@dataclass(frozen=True)
class Failure:
    """Samples in a row that failed alike.

    start, end: times of the first and the last [s];  first: index of the first;  count: of them.
    status:     name of the status;  cause: in words.
    owner_kind: chain, contact, platform or sample;  owner_name: of the chain or contacts.
    """

    start: float
    end: float
    first: int
    count: int
    status: str
    cause: str
    owner_kind: str
    owner_name: str

    def __str__(self) -> str:
        when = f"{self.start:g} s" if self.count == 1 else f"{self.start:g} to {self.end:g} s"
        count = "1 sample" if self.count == 1 else f"{self.count} samples"
        return f"t = {when} ({count}): {self.status}, {self.cause}"


def failures(solution: Solution) -> list[Failure]:
    """Every interval of failed samples of a solution, in order."""
    status, time = solution["status"].values, solution["time"].values
    if not status.any():
        return []
    cause = solution["cause"].values if "cause" in solution else np.zeros_like(status)
    possible = owners(solution.mechanism)
    turns = np.flatnonzero((np.diff(status) != 0) | (np.diff(cause) != 0)) + 1
    starts, ends = np.append(0, turns), np.append(turns, len(status))
    return [
        Failure(
            start=float(time[start]),
            end=float(time[end - 1]),
            first=int(start),
            count=int(end - start),
            status=STATUS_NAMES[status[start]],
            cause=cause_text(int(status[start]), possible[cause[start]]),
            owner_kind=possible[cause[start]].kind,
            owner_name=possible[cause[start]].name,
        )
        for start, end in zip(starts, ends, strict=True)
        if status[start] != Status.ok
    ]


def status_columns(
    mechanism: Mechanism, status: np.ndarray, cause: np.ndarray
) -> dict[str, np.ndarray | list[str]]:
    """Columns `status` and `cause` of a CSV; the cause of a sample that is ok is empty."""
    words = [str(owner) for owner in owners(mechanism)]
    return {"status": _words(STATUS_NAMES, status), "cause": _words(words, cause)}


def _words(words: Sequence[str], index: np.ndarray) -> list[str]:
    return [words[i] for i in index.tolist()]
