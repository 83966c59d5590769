"""Compiled kernels: found in the cache or built, loaded with ctypes (which releases the GIL), run
on arrays.

The kernel of a question serves every mechanism of its structure.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from copy import copy
from functools import partial

import numpy as np

from ...errors import InputError
from ...graph.program import Interface, Numbers, Variants
from ..kernel import Answer, columns_of, results_of
from ..threads import shared_out, workers
from .build import loaded
from .shared_library import aligned, prepared

# Vector operations that are worth a thread of their own: some 0.3 ms.
WORTH_A_THREAD = 1_000_000
UNIT = 64  # samples of which pieces are multiples: whole vectors at any width


class CompiledKernel:
    """One mechanism's numbers in a compiled question.

    Attributes: order: where each lane stands among the callers'.
                facts: compilers, flags, operation count, where the library is.
                cached: whether it was there already.
    """

    name = "compiled"

    def __init__(self, key: str, build: Callable[[], Variants], numbers: Numbers) -> None:
        """Args:   key: of everything that shapes what `build` returns.
        Raises: CompilerError: where no kernel can be built.
        """
        entry, self._library = loaded(key, build)
        self.facts, self.cached = entry.facts, entry.cached
        self.interface = Interface.of(self.facts["interface"])
        self.columns = sum(self.interface.width(r) for r in self.interface.results)
        self._prepare(numbers)

    def renumbered(self, numbers: Numbers) -> CompiledKernel:
        """The same kernel on the numbers of another mechanism of its structure."""
        other = copy(self)
        other._prepare(numbers)
        return other

    def _prepare(self, numbers: Numbers) -> None:
        self.order = numbers.order
        self._table = prepared(self._library, self.facts, numbers)

    def run(self, inputs: Mapping[str, np.ndarray], threads: int | None = None) -> Answer:
        """Evaluate samples; columns that are contiguous or constant are fastest."""
        count, columns = columns_of(self.interface, inputs, self.order)
        columns = [_readable(column) for column in columns]
        status = np.empty(count, dtype=np.uint8)
        rows = -(-count // UNIT) * UNIT
        results = aligned(self.columns * rows).reshape(self.columns, rows)
        strides = [column.strides[0] // 8 for column in columns]
        starts = [column.ctypes.data for column in columns]
        steps = (ctypes.c_ssize_t * len(columns))(*strides)
        table, out, judged = self._table.ctypes.data, results.ctypes.data, status.ctypes.data

        def piece(start: int, end: int) -> None:
            at = (ctypes.c_void_p * len(columns))(
                *(a + 8 * s * start for a, s in zip(starts, strides, strict=True))
            )
            self._library.batch(
                table,
                ctypes.addressof(at),
                ctypes.addressof(steps),
                end - start,
                out + 8 * start,
                rows,
                judged + start,
            )

        work = self.facts["operations"] * count // self.facts["lanes"]
        shared_out(piece, count, min(workers(threads), 1 + work // WORTH_A_THREAD), UNIT)
        return Answer(results_of(self.interface, results[:, :count], self.order), status)

    def one(self, sample: np.ndarray) -> tuple[np.ndarray, int]:
        """Evaluate one sample, (columns,), at least latency: all results in a row, and a status.

        Lanes stand group by group, in and out.
        """
        if sample.shape != (self.interface.columns,):
            raise InputError(
                f"a sample of this kernel has {self.interface.columns} numbers; got {sample.shape}"
            )
        given = np.zeros(self.interface.columns + self.facts["lanes"])
        given[: len(sample)] = sample
        found = np.empty(self.columns + self.facts["checks"])
        status = self._library.one(self._table.ctypes.data, given.ctypes.data, found.ctypes.data)
        return found[: self.columns], status

    def single(self) -> Single:
        """`one` with places of its own for what goes in and out: for one thread."""
        return Single(self)

    @property
    def address(self) -> tuple[int, int, int]:
        """Addresses of `one`, of `batch` and of the table, to call them from C."""
        one, batch = (
            ctypes.cast(getattr(self._library, name), ctypes.c_void_p).value or 0
            for name in ("one", "batch")
        )
        return one, batch, self._table.ctypes.data


# Holds the GIL, since to give it away and take it back costs more than some evaluations.
ONE = ctypes.PYFUNCTYPE(ctypes.c_int, *[ctypes.c_void_p] * 3)


class Single:
    """One evaluation after the other, bound to buffers: what a control loop calls.

    Attributes: given: (columns,), to be filled;  found: (results,), lanes group by group.
                run: evaluates `given`; returns the status.
                addresses: of the C function and of what it is called with, for other C: table,
                `given`, `found`.
    """

    def __init__(self, kernel: CompiledKernel) -> None:
        self._kernel = kernel  # whose table and library have to stay
        columns, results = kernel.interface.columns, kernel.columns
        given = aligned(columns + kernel.facts["lanes"])
        found = aligned(results + kernel.facts["checks"])
        given[:] = 0.0
        self.given, self.found = given[:columns], found[:results]
        one, _, table = kernel.address
        self.addresses = one, table, given.ctypes.data, found.ctypes.data
        self.run: Callable[[], int] = partial(ONE(one), *self.addresses[1:])


def _readable(column: np.ndarray) -> np.ndarray:
    """A column that C can read: aligned, whole numbers of doubles apart."""
    if column.strides[0] % 8 or not column.flags.aligned:  # a view into a record, say
        return column.copy()
    return column
