"""What every backend makes of a program: a function of arrays of samples."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..errors import InputError
from ..graph.program import Interface, Numbers, Port, Result

OK, AGAIN = 0, 255  # statuses; others are those of the program's checks


@dataclass(frozen=True)
class Answer:
    """Results at N samples.

    values: name -> (*shape, N), or (*shape, lanes, N), lanes in the callers' order.
    status: (N,), 0, AGAIN or that of a check.
    """

    values: dict[str, np.ndarray]
    status: np.ndarray


class Kernel(Protocol):
    """One mechanism's numbers in a program, ready to run."""

    name: str
    interface: Interface
    order: tuple[int, ...]  # where each lane stands among the callers'

    def renumbered(self, numbers: Numbers) -> Kernel:
        """The same kernel on the numbers of another mechanism of its structure."""
        ...

    def run(self, inputs: Mapping[str, np.ndarray], threads: int | None = None) -> Answer:
        """Evaluate samples.

        Args: inputs: port -> (N, size), (N, lanes) in the callers' order, or (N, size, lanes); of
              one row where it is the same for all samples.
              threads: at most so many; results do not depend on it.
        """
        ...


def columns_of(
    interface: Interface, inputs: Mapping[str, np.ndarray], order: tuple[int, ...]
) -> tuple[int, list[np.ndarray]]:
    """How many samples there are, and every input column, (N,) each, as views where possible.

    Raises: InputError: for an array that does not fit its port.
    """
    columns: list[np.ndarray] = []
    given = [_fitting(interface, port, inputs[port.name]) for port in interface.ports]
    count = max((len(a) for a in given if len(a) != 1), default=min(map(len, given), default=0))
    for port, a in zip(interface.ports, given, strict=True):
        if len(a) != count:
            if len(a) != 1:
                raise InputError(f"{port.name}: {len(a)} samples, where others have {count}")
            a = np.broadcast_to(a, (count, *a.shape[1:]))
        if not port.lanes:
            columns += [a[:, i] for i in range(port.size)]
            continue
        for i in range(port.size):
            rows = a if port.size == 1 else a[:, i]
            columns += [rows[:, k] for k in order]
    return count, columns


def _fitting(interface: Interface, port: Port, given: object) -> np.ndarray:
    a = _numbers(port.name, given)
    want: tuple[int, ...] = (port.size,)
    if port.lanes:
        want = (interface.lanes,) if port.size == 1 else (port.size, interface.lanes)
    if a.shape[1:] != want:
        shape = ", ".join(["N", *map(str, want)])
        one = " (one sample is an array of one)" if a.ndim == 1 and a.shape == want else ""
        raise InputError(f"{port.name}: expected an array of shape ({shape}), got {a.shape}{one}")
    return a


def _numbers(name: str, given: object) -> np.ndarray:
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        kind = type(given).__name__
        raise InputError(
            f"{name}: expected an array of numbers, got {kind} {given!r:.60}"
        ) from None


def results_of(
    interface: Interface, columns: np.ndarray, order: tuple[int, ...]
) -> dict[str, np.ndarray]:
    """Every result of columns, (width of all, N), by name; see `arranged`."""
    values, row = {}, 0
    for r in interface.results:
        end = row + interface.width(r)
        values[r.name] = arranged(interface, r, columns[row:end], order)
        row = end
    return values


def arranged(
    interface: Interface, result: Result, block: np.ndarray, order: tuple[int, ...]
) -> np.ndarray:
    """Columns of a result, (width, N), as its shape has it; lanes in the callers' order."""
    count = block.shape[1]
    if not result.lanes:
        return block.reshape(*result.shape, count)
    starts = np.cumsum([0, *interface.counts])
    mine = [k for g in result.groups for k in order[starts[g] : starts[g + 1]]]
    found = block.reshape(math.prod(result.shape), len(mine), count)
    if mine != sorted(mine):
        found = found[:, np.argsort(mine)]
    return found.reshape(*result.shape, len(mine), count)
