"""When and why samples failed: intervals of one status and one cause."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isnan, nan
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kinematics.causes import cause_text, owners, shortfall_text
from ..mechanism.mechanism import Mechanism
from ..mechanism.vocabulary import words_of
from ..status import STATUS_NAMES, Status

if TYPE_CHECKING:
    import xarray as xr

MOST = 500  # intervals that a figure or a page shows


@dataclass(frozen=True)
class Failure:
    """Samples in a row that failed alike.

    start, end: times of the first and the last [s], NaN in maps and sweeps;  first: index of the
                first;  count: of them.
    status:     name of the status;  cause: in words.
    owner_kind: chain, contact, platform or sample;  owner_name: of the chain or contacts.
    shortfall:  of infeasible samples, the largest number by which limits would have to be
                multiplied; inf where no limits would do.
    """

    start: float
    end: float
    first: int
    count: int
    status: str
    cause: str
    owner_kind: str
    owner_name: str
    shortfall: float | None = None

    @property
    def text(self) -> str:
        """Status and cause."""
        return f"{self.status}: {self.cause}" if self.cause else self.status

    def __str__(self) -> str:
        if isnan(self.start):
            when = f"row {self.first + 1}"
        else:
            ends = (self.start, self.end)[: self.count]
            when = f"t = {' to '.join(f'{t:g}' for t in ends)} s"
        count = "1 sample" if self.count == 1 else f"{self.count} samples"
        needed = "" if self.shortfall is None else f"; {shortfall_text(self.shortfall)}"
        return f"{when} ({count}): {self.status}, {self.cause}{needed}"


def longest(found: Sequence[Failure], most: int = MOST) -> list[Failure]:
    """The longest ones, in the order of time: a screen cannot show more apart."""
    kept = sorted(found, key=lambda one: one.start - one.end)[:most]
    return sorted(kept, key=lambda one: one.first)


def at_sample(found: Sequence[Failure], sample: int) -> Failure | None:
    """The interval that a sample is in, or None."""
    return next((one for one in found if one.first <= sample < one.first + one.count), None)


@contextmanager
def complete_dataset() -> Iterator[None]:
    """Where a dataset is read that may be none of condyle's, or part of one.

    Raises: InputError: if a variable or attribute is missing.
    """
    try:
        yield
    except KeyError as error:
        raise InputError(
            f"this dataset is not a complete result of condyle: {error.args[0]} is missing"
        ) from None


def failures(solution: xr.Dataset) -> list[Failure]:
    """Every interval of failed samples of a solution or map, in order; failed rows of a sweep."""
    if "reason" in solution:
        rows = enumerate(zip(solution["status"].values, solution["reason"].values, strict=True))
        return [Failure(nan, nan, i, 1, *why, "sample", "") for i, why in rows if why[0] != "ok"]
    status = solution["status"].values.ravel()
    if not status.any():
        return []
    time = solution["time"].values if "time" in solution else np.full(status.size, nan)
    cause = solution["cause"].values.ravel() if "cause" in solution else np.zeros_like(status)
    mechanism = solution.condyle.mechanism
    possible, say = owners(mechanism), words_of(mechanism)
    turns = np.flatnonzero((np.diff(status) != 0) | (np.diff(cause) != 0)) + 1
    starts, ends = np.append(0, turns), np.append(turns, len(status))
    return [
        Failure(
            start=float(time[start]),
            end=float(time[end - 1]),
            first=int(start),
            count=int(end - start),
            status=STATUS_NAMES[status[start]],
            cause=say(cause_text(int(status[start]), possible[cause[start]])),
            owner_kind=possible[cause[start]].kind,
            owner_name=possible[cause[start]].name,
            shortfall=_largest(solution, slice(start, end), int(status[start])),
        )
        for start, end in zip(starts, ends, strict=True)
        if status[start] != Status.ok
    ]


def _largest(solution: xr.Dataset, rows: slice, status: int) -> float | None:
    if status != Status.infeasible or "shortfall" not in solution:
        return None
    return float(solution["shortfall"].values[rows].max())


def status_columns(
    mechanism: Mechanism,
    status: np.ndarray,
    cause: np.ndarray,
    shortfall: np.ndarray | None = None,
) -> dict[str, np.ndarray | list[str]]:
    """Columns `status` and `cause` of a CSV; the cause of a sample that is ok is empty.

    Where efforts have limits, `shortfall` besides: see `Derived.shortfall`.
    """
    words = [str(owner) for owner in owners(mechanism)]
    columns: dict[str, np.ndarray | list[str]] = {
        "status": [STATUS_NAMES[i] for i in status.tolist()],
        "cause": [words[i] for i in cause.tolist()],
    }
    return columns if shortfall is None else columns | {"shortfall": shortfall}
