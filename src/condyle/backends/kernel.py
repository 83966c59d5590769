"""What every backend makes of a program: a function of arrays of samples.

A kernel holds the numbers of one or several mechanisms of its structure. With several, an input
`variant`, (N,), is the mechanism of each sample; it is quickest if samples of one mechanism follow
one another.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..errors import InputError, brief
from ..graph.program import Interface, Numbers

Arrays = dict[str, np.ndarray]
Results = tuple[Arrays, np.ndarray | int]
DOUBLE = np.dtype(np.float64)
NONE: frozenset[str] = frozenset()
VARIANT = "variant"
OK, AGAIN = 0, 255  # statuses; others are those of the program's checks


@dataclass(frozen=True)
class KernelValues:
    """Results at N samples.

    values: name -> (*shape, N), or (*shape, lanes, N), lanes in the callers' order.
    status: (N,), 0, AGAIN or that of a check.
    """

    values: dict[str, np.ndarray]
    status: np.ndarray

    def without(self, some: frozenset[str]) -> KernelValues:
        """The same but for results that are not wanted."""
        if not some:
            return self
        return KernelValues({n: a for n, a in self.values.items() if n not in some}, self.status)

    def mend(self, inputs: Mapping[str, np.ndarray], robust: Callable[[Arrays], Results]) -> None:
        """Replace what the kernel cannot vouch for, in place, by what another finds.

        Args: robust: results by name, samples last, and statuses, from some samples' inputs.
        """
        if np.count_nonzero(self.status) and (again := np.flatnonzero(self.status == AGAIN)).size:
            few = sample_rows(inputs, again, len(self.status))
            better, self.status[again] = robust(few)
            for name, value in self.values.items():
                value[..., again] = better[name]


def sample_rows(inputs: Mapping[str, np.ndarray], rows: np.ndarray, count: int) -> Arrays:
    """Some of N samples of every input, by index."""
    return {
        name: np.broadcast_to(a, (count, *a.shape[1:]))[rows] if len(a) != count else a[rows]
        for name, a in inputs.items()
    }


class Kernel(Protocol):
    """A program with the numbers of its mechanisms, ready to run."""

    name: str
    interface: Interface
    order: tuple[int, ...]  # where each lane stands among the callers'

    def renumbered(self, numbers: Numbers) -> Kernel:
        """The same kernel on the numbers of other mechanisms of its structure."""
        ...

    def run(
        self,
        inputs: Mapping[str, np.ndarray],
        threads: int | None = None,
        without: frozenset[str] = NONE,
    ) -> KernelValues:
        """Evaluate samples.

        Args: inputs: port -> (N, size), (N, lanes) in the callers' order, or (N, size, lanes); of
              one row where it is the same for all samples. `variant` only with several mechanisms.
              threads: maximum number; results do not depend on it.
              without: results that are not wanted.
        """
        ...


def variant_runs(variant: np.ndarray) -> np.ndarray:
    """Where each run of samples of one mechanism starts, and N: what `pairwise` makes slices of."""
    return np.flatnonzero(np.diff(variant, prepend=-1, append=-1))


def run_by_variant(
    kernel: Kernel,
    numbers: Numbers,
    inputs: Mapping[str, np.ndarray],
    threads: int | None,
    without: frozenset[str],
) -> KernelValues:
    """Samples of several mechanisms by a kernel that takes one at a time, run after run."""
    variant, parts = inputs[VARIANT], []
    for start, end in pairwise(variant_runs(variant).tolist()):
        own = kernel.renumbered(numbers.single(int(variant[start])))
        rows = sample_rows(inputs, np.arange(start, end), len(variant))
        parts.append(own.run(rows, threads, without))
    if not parts:  # no samples at all
        none = {name: a[:0] for name, a in inputs.items()}
        parts = [kernel.renumbered(numbers.single(0)).run(none, threads, without)]
    values = {
        name: np.concatenate([part.values[name] for part in parts], axis=-1)
        for name in parts[0].values
    }
    return KernelValues(values, np.concatenate([part.status for part in parts]))


def shapes_of(interface: Interface) -> dict[str, tuple[int, ...]]:
    """Every port's shape behind that of the samples."""
    lanes = interface.lanes
    return {
        port.name: (port.size,)
        if not port.lanes
        else (lanes,)
        if port.size == 1
        else (port.size, lanes)
        for port in interface.ports
    }


def arrays_of(
    shapes: Mapping[str, tuple[int, ...]], inputs: Mapping[str, np.ndarray]
) -> tuple[int, list[np.ndarray]]:
    """How many samples there are, and every port's array: as many rows, or one.

    Raises: InputError: for an array that does not fit its port.
    """
    count, given = 1 if shapes else 0, []
    for name, shape in shapes.items():
        a = inputs[name]
        if type(a) is not np.ndarray or a.dtype is not DOUBLE or a.shape[1:] != shape:
            a = _fitting(name, shape, a)
        given.append(a)
        if len(a) != 1:
            count = len(a)
    for name, a in zip(shapes, given, strict=True):
        if len(a) not in (1, count):
            raise InputError(f"{name}: {len(a)} samples, where others have {count}")
    return count, given


def columns_of(
    interface: Interface, inputs: Mapping[str, np.ndarray], order: tuple[int, ...]
) -> tuple[int, list[np.ndarray]]:
    """How many samples there are, and every input column, (N,) each, as views."""
    count, given = arrays_of(shapes_of(interface), inputs)
    columns: list[np.ndarray] = []
    for port, a in zip(interface.ports, given, strict=True):
        if len(a) != count:
            a = np.broadcast_to(a, (count, *a.shape[1:]))
        blocks = [a[:, i] for i in range(port.size)] if port.size > 1 and port.lanes else [a]
        lanes = order if port.lanes else range(port.size)
        columns += [block[:, k] for block in blocks for k in lanes]
    return count, columns


def column_steps(
    interface: Interface,
    given: Sequence[Any],
    order: tuple[int, ...],
    count: int,
    address: Callable[[Any], int],
) -> tuple[list[int], list[int]]:
    """Where every input column starts, and the bytes from sample to sample, 0 for a constant.

    Args: given: an array for every port, also of a device;  address: of an array.
    """
    starts: list[int] = []
    steps: list[int] = []
    for port, a in zip(interface.ports, given, strict=True):
        first, (row, *within) = address(a), a.strides
        lanes = order if port.lanes else range(port.size)
        blocks = [first]
        if port.lanes and port.size > 1:
            blocks = [first + i * within[0] for i in range(port.size)]
        starts += [block + k * within[-1] for block in blocks for k in lanes]
        steps += [row if len(a) == count else 0] * (len(blocks) * len(lanes))
    return starts, steps


def _fitting(name: str, want: tuple[int, ...], given: object) -> np.ndarray:
    a = _numbers(name, given)
    if a.shape[1:] != want:
        shape = ", ".join(["N", *map(str, want)])
        one = " (one sample is an array of one)" if a.ndim == 1 and a.shape == want else ""
        raise InputError(f"{name}: expected an array of shape ({shape}), got {a.shape}{one}")
    return a


def _numbers(name: str, given: object) -> np.ndarray:
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        kind = type(given).__name__
        raise InputError(
            f"{name}: expected an array of numbers, got {kind} {brief(given)}"
        ) from None


class ResultPlace(NamedTuple):
    """Where a result stands among the columns; `moved`: the lanes in the callers' order."""

    name: str
    start: int
    end: int
    shape: tuple[int, ...]
    moved: np.ndarray | None


def places_of(interface: Interface, order: tuple[int, ...]) -> list[ResultPlace]:
    """The place of every result."""
    starts, places, row = np.cumsum([0, *interface.counts]), [], 0
    for r in interface.results:
        end, shape, moved = row + interface.width(r), r.shape, None
        if r.lanes:
            mine = [k for g in r.groups for k in order[starts[g] : starts[g + 1]]]
            shape = (*r.shape, len(mine))
            moved = None if mine == sorted(mine) else np.argsort(mine)
        places.append(ResultPlace(r.name, row, end, shape, moved))
        row = end
    return places


def results_at(places: list[ResultPlace], columns: np.ndarray, count: int) -> dict[str, np.ndarray]:
    """Every result of columns, (width of all, N or more), by name, as its shape has it."""
    values = {}
    for name, start, end, shape, moved in places:
        block = columns[start:end, :count]
        if len(shape) != 1:
            block = block.reshape(*shape, count)
        values[name] = block if moved is None else block.take(moved, axis=-2)
    return values


def results_of(
    interface: Interface, columns: np.ndarray, order: tuple[int, ...]
) -> dict[str, np.ndarray]:
    """Every result of columns, (width of all, N), by name."""
    return results_at(places_of(interface, order), columns, columns.shape[1])
