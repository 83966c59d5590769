"""Compiled kernels: found in the cache or built, loaded with ctypes (which releases the GIL), run
on arrays.

The kernel of a question serves every mechanism of its structure.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import lru_cache, partial
from typing import Any

import numpy as np

from ...errors import InputError
from ...graph.program import Interface, Numbers, Programs
from ..compiler import CompilerError
from ..kernel import (
    NONE,
    VARIANT,
    KernelValues,
    ResultPlace,
    arrays_of,
    column_steps,
    columns_of,
    places_of,
    results_at,
    results_of,
    shapes_of,
    variant_runs,
)
from ..threads import shared_out, workers
from .build import loaded
from .first_check import Way, require_numpys_values
from .shared_library import aligned, padded, prepared

# Vector operations that are worth a thread of their own: some 0.3 ms.
WORTH_A_THREAD = 1_000_000
COPIED_SAMPLES = 512  # samples that are copied
LINE = 8  # doubles of a cache line
UNIT = 64  # samples of which pieces are multiples: whole vectors at any width


class CompiledKernel:
    """A compiled question with the numbers of its mechanisms.

    Attributes: order: where each lane stands among the callers'.
                facts: compilers, flags, operation count, where the library is.
                cached: whether it was there already.

    Single samples and C have the numbers of the first mechanism.
    """

    name = "compiled"

    def __init__(self, key: str | None, build: Callable[[], Programs], numbers: Numbers) -> None:
        """Args:   key: of everything that shapes what `build` returns, or None: see `loaded`.
        Raises: CompilerError: where no kernel can be built.
        """
        entry, library = loaded(key, build, partial(_compared, numbers))
        self._begin(library, entry.facts, entry.cached, numbers)

    def _begin(
        self, library: ctypes.CDLL, facts: dict[str, Any], cached: bool, numbers: Numbers
    ) -> None:
        self._library = library
        self.facts: dict[str, Any] = facts
        self.cached: bool = cached
        self.interface: Interface = Interface.of(self.facts["interface"])
        self.columns: int = sum(self.interface.width(r) for r in self.interface.results)
        self._prepare(numbers)

    def renumbered(self, numbers: Numbers) -> CompiledKernel:
        """As of `Kernel`."""
        other = copy(self)
        other._prepare(numbers)
        return other

    def _prepare(self, numbers: Numbers) -> None:
        self.order: tuple[int, ...] = numbers.order
        self._numbers, self._single = numbers, len(numbers) == 1
        self._table = prepared(self._library, self.facts, numbers)
        self._address = _address(self._table)
        self._parts: dict[frozenset[str], Some] = {}
        self._shapes = shapes_of(self.interface)
        self._vector = ctypes.c_ssize_t * self.interface.columns
        self._steps = self._vector(*[1] * self.interface.columns)
        self._per_thread = threading.local()

    def run(
        self,
        inputs: Mapping[str, np.ndarray],
        threads: int | None = None,
        without: frozenset[str] = NONE,
    ) -> KernelValues:
        """Evaluate samples; columns that are contiguous or constant are fastest."""
        if not self._single:
            return self._run_by_variant(inputs, threads, without)
        count, given = arrays_of(self._shapes, inputs)
        some = self._some(without)
        # An odd number of lines: columns a power of two apart would have to share places in caches.
        rows = -(-count // UNIT) * UNIT + LINE
        status, raw = np.empty(count, dtype=np.uint8), np.empty(some.columns * rows + LINE)
        start = _address(raw)
        skipped = -start // 8 % LINE  # to a cache line, as vector loads like it
        results = raw[skipped : skipped + some.columns * rows].reshape(some.columns, rows)
        goal = start + 8 * skipped, rows, _address(status)
        if count <= COPIED_SAMPLES:
            if threads is not None:
                workers(threads)
            block = self._copied(count, given)
            self._library.batch_some(self._address, *block, count, *goal, *some.stored)
        else:
            self._run_many(count, given, goal, some, threads)
        return KernelValues(results_at(some.places, results, count), status)

    def _run_by_variant(
        self, inputs: Mapping[str, np.ndarray], threads: int | None, without: frozenset[str]
    ) -> KernelValues:
        """Every thread prepares the numbers of a mechanism, then evaluates a run of its samples."""
        variant, numbers = inputs[VARIANT], self._numbers
        cuts = variant_runs(variant)
        count, runs = len(variant), len(cuts) - 1
        _, given = arrays_of(self._shapes, inputs)
        given = [_readable(a) for a in given]
        some = self._some(without)
        status, raw = np.empty(count, dtype=np.uint8), np.empty(some.columns * count)
        starts, steps = column_steps(self.interface, given, self.order, count, _address)
        steps = [0 if count == 1 else step for step in steps]
        first = cuts[:-1, None]
        columns = np.ascontiguousarray(np.array(starts, dtype=np.int64) + first * np.array(steps))
        blocks = [
            np.ascontiguousarray(padded(own, pad, self.facts["lanes"]))
            for own, pad in zip(numbers.lanes, numbers.padding, strict=True)
        ]
        rows = variant[cuts[:-1]].astype(np.int64)[:, None]
        lanes = np.array([[_address(b) for b in blocks]], dtype=np.int64) + rows * np.array(
            [b.strides[0] for b in blocks], dtype=np.int64
        )
        parameters = np.ascontiguousarray(numbers.parameters)
        ends, owners = cuts.tolist(), rows[:, 0].tolist()
        strides = _vector_of(tuple(step // 8 for step in steps))
        library, out, judged = self._library, _address(raw), _address(status)
        at_columns, at_lanes, at_numbers = map(_address, (columns, lanes, parameters))
        width, groups, size = 8 * len(starts), 8 * len(blocks), parameters.strides[0]

        def piece(start: int, end: int) -> None:
            own = aligned(self.facts["table_size"])  # of this thread
            table, prepare, batch = _address(own), library.prepare, library.batch_some
            for r in range(start, end):
                prepare(at_numbers + size * owners[r], at_lanes + groups * r, table)
                s, e = ends[r], ends[r + 1]
                at = at_columns + width * r
                batch(table, at, strides, e - s, out + 8 * s, count, judged + s, *some.stored)

        most = 1 + self.facts["operations"] * count // self.facts["lanes"] // WORTH_A_THREAD
        shared_out(piece, runs, min(workers(threads), most), 1)
        return KernelValues(
            results_at(some.places, raw.reshape(some.columns, count), count), status
        )

    def _some(self, without: frozenset[str]) -> Some:
        """What is stored of results where some are left out."""
        if without not in self._parts:
            places, wanted = [], list[int]()
            for p in places_of(self.interface, self.order):
                if p.name not in without:
                    start = len(wanted)
                    wanted += range(p.start, p.end)
                    places.append(p._replace(start=start, end=len(wanted)))
            which = np.array(wanted, dtype=np.intc)
            self._parts[without] = Some(places, len(wanted), which)
        return self._parts[without]

    def _copied(self, count: int, given: Sequence[np.ndarray]) -> tuple[Any, Any]:
        """Where columns start, and the steps from sample to sample, of inputs side by side.

        Few numbers are copied sooner than asked where they are. They stay until this thread copies
        the next.
        """
        try:
            places, starts = self._per_thread.block
        except AttributeError:
            places, starts = self._per_thread.block = self._block()
        for (place, order), a in zip(places, given, strict=True):
            place[..., :count] = a.T if order is None else a.T[order]
        return starts, self._steps

    def _block(self) -> tuple[list[tuple[np.ndarray, np.ndarray | None]], Any]:
        """Room for few samples, as every port takes it with the order of its lanes; where columns
        start."""
        face, order = self.interface, np.array(self.order)
        block = np.empty((face.columns, COPIED_SAMPLES))
        places = []
        for port in face.ports:
            end = port.start + port.size * (face.lanes if port.lanes else 1)
            place = block[port.start : end]
            if port.lanes and port.size > 1:
                place = place.reshape(port.size, face.lanes, COPIED_SAMPLES).swapaxes(0, 1)
            moved = port.lanes and (np.diff(order) < 0).any()
            places.append((place, order if moved else None))
        return places, self._vector(*(_address(block[k]) for k in range(face.columns)))

    def _run_many(
        self,
        count: int,
        given: Sequence[np.ndarray],
        goal: tuple[int, int, int],
        some: Some,
        threads: int | None,
    ) -> None:
        given = [_readable(a) for a in given]  # has to stay as long as C reads it
        starts, steps = column_steps(self.interface, given, self.order, count, _address)
        strides = [step // 8 for step in steps]
        vector, call = self._vector, self._library.batch_some
        steps_at, (out, rows, judged) = _vector_of(tuple(strides)), goal

        def piece(start: int, end: int) -> None:
            moved = starts
            if start:
                moved = [a + 8 * s * start for a, s in zip(starts, strides, strict=True)]
            args = self._address, vector(*moved), steps_at, end - start
            call(*args, out + 8 * start, rows, judged + start, *some.stored)

        most = 1 + self.facts["operations"] * count // self.facts["lanes"] // WORTH_A_THREAD
        n_threads = 1 if threads is None and most == 1 else min(workers(threads), most)
        shared_out(piece, count, n_threads, UNIT)

    def evaluate(self, sample: np.ndarray) -> tuple[np.ndarray, int]:
        """Evaluate one sample, (columns,), at least latency: all results in a row, and a status.

        Lanes stand group by group, in and out.
        """
        if sample.shape != (self.interface.columns,):
            raise InputError(
                f"a sample of this kernel has {self.interface.columns} numbers; got {sample.shape}"
            )
        given = np.zeros(self.interface.columns + self.facts["lanes"])
        given[: len(sample)] = sample
        outputs = np.empty(self.columns + self.facts["checks"])
        status = self._library.one(self._table.ctypes.data, given.ctypes.data, outputs.ctypes.data)
        return outputs[: self.columns], status

    def one_by_one(self, inputs: Mapping[str, np.ndarray]) -> KernelValues:
        """What `run` returns, by `one`, sample after sample."""
        _, columns = columns_of(self.interface, inputs, self.order)
        found = [self.evaluate(sample) for sample in np.column_stack(columns)]
        rows = np.array([row for row, _ in found]).reshape(-1, self.columns)
        status = np.array([status for _, status in found], dtype=np.uint8)
        return KernelValues(results_of(self.interface, rows.T, self.order), status)

    def single(self) -> Single:
        """`one` with places of its own for what goes in and out: for one thread."""
        return Single(self)

    @property
    def address(self) -> tuple[int, int, int]:
        """Addresses of `one`, if there is one, `batch` and the table, to call them from C."""
        single, batch = (
            ctypes.cast(getattr(self._library, name, 0), ctypes.c_void_p).value or 0
            for name in ("one", "batch")
        )
        return single, batch, self._table.ctypes.data


class Some:
    """Some of a kernel's results, in columns side by side.

    stored: which of all columns they are, as C takes it, and how many.
    """

    def __init__(self, places: list[ResultPlace], columns: int, which: np.ndarray) -> None:
        self.places: list[ResultPlace] = places
        self.columns: int = columns
        self._which = which  # has to stay
        self.stored: tuple[int, int] = _address(which), columns


def _compared(
    numbers: Numbers, library: ctypes.CDLL, facts: dict[str, Any], variants: Programs
) -> None:
    """Hold a kernel that was just built against numpy.

    Raises: CompilerError: where it is not what was asked for.
    """
    own = CompiledKernel.__new__(CompiledKernel)
    numbers = numbers.single(0)
    own._begin(library, facts, False, numbers)
    ways: list[Way] = [lambda other, ports: own.renumbered(other).run(ports, threads=1)]
    if own.address[0]:
        ways.append(lambda other, ports: own.renumbered(other).one_by_one(ports))
    try:
        require_numpys_values(ways, variants, numbers)
    except CompilerError as error:
        command = " ".join(facts["compiler"])
        raise CompilerError(f"{command} made a kernel whose numbers are wrong: {error}") from None


# Holds the GIL, since to give it away and take it back costs more than some evaluations.
ONE_SAMPLE = ctypes.PYFUNCTYPE(ctypes.c_int, *[ctypes.c_void_p] * 3)


class Single:
    """One evaluation after the other, bound to buffers: what a control loop calls.

    Attributes: given: (columns,), to be filled;  outputs: (results,), lanes group by group.
                run: evaluates `given`; returns the status.
                addresses: of the C function and of what it is called with, for other C: table,
                `given`, `outputs`.
    """

    def __init__(self, kernel: CompiledKernel) -> None:
        self._kernel = kernel  # whose table and library have to stay
        columns, results = kernel.interface.columns, kernel.columns
        given = aligned(columns + kernel.facts["lanes"])
        outputs = aligned(results + kernel.facts["checks"])
        given[:] = 0.0
        self.given: np.ndarray = given[:columns]
        self.outputs: np.ndarray = outputs[:results]
        function, _, table = kernel.address
        self.addresses: tuple[int, int, int, int] = (
            function,
            table,
            given.ctypes.data,
            outputs.ctypes.data,
        )
        self.run: Callable[[], int] = partial(ONE_SAMPLE(function), *self.addresses[1:])


def _readable(a: np.ndarray) -> np.ndarray:
    """An array that C can read: aligned, whole numbers of doubles apart."""
    if a.flags.aligned and not any(step % 8 for step in a.strides):
        return a
    return a.copy()  # of a view into a record, say


@lru_cache(maxsize=256)
def _vector_of(numbers: tuple[int, ...]) -> ctypes.Array[ctypes.c_ssize_t]:
    """As C takes them; never written to."""
    return (ctypes.c_ssize_t * len(numbers))(*numbers)


def _address(a: np.ndarray) -> int:
    """The address of the first number; quicker than `a.ctypes.data`."""
    found: int = a.__array_interface__["data"][0]
    return found
