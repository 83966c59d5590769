"""A kernel whose inputs and results stand in rows of its own, one column a run.

One evaluation after the other, whichever backend runs it, and for compiled code that steps many
runs at once: it reads and writes the same rows.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from ..backends.c.compiled_kernel import ONE_SAMPLE, CompiledKernel
from ..backends.c.shared_library import aligned
from ..backends.kernel import Kernel, shapes_of
from ..graph.program import Numbers
from ..graph.transform import number_ports
from ..model.model import Model

SPARE = 64  # rows that a kernel may read past its inputs
ALIGNED = 8  # numbers


class KernelColumns:
    """Rows of a kernel by name, chains in the callers' order.

    given, found: inputs and results, (rows, runs) each;  stride: numbers from row to row.
    """

    def __init__(self, kernel: Kernel, runs: int = 1) -> None:
        self.kernel: Kernel = kernel
        face = kernel.interface
        self.stride: int = 1 if runs == 1 else -(-runs // ALIGNED) * ALIGNED
        order = np.array(kernel.order, dtype=int)
        lanes = np.empty(face.lanes, dtype=int)
        lanes[order] = np.arange(face.lanes)
        self._ports: dict[str, np.ndarray] = {}
        for port in face.ports:
            own = np.arange(port.size)
            rows = (own[:, None] * face.lanes + lanes).ravel() if port.lanes else own
            self._ports[port.name] = port.start + rows
        self._results: dict[str, np.ndarray] = {}
        start = 0
        for result in face.results:
            rows = start + np.arange(face.width(result))
            start += len(rows)
            self._results[result.name] = rows[lanes] if result.lanes else rows
        self.results = start
        checks = kernel.facts["checks"] if isinstance(kernel, CompiledKernel) else 0
        self.all_given: np.ndarray = self._rows(face.columns + SPARE)
        self.all_found: np.ndarray = self._rows(start + checks)
        self.given: np.ndarray = self.all_given[:, :runs]
        self.found: np.ndarray = self.all_found[:, :runs]
        if isinstance(kernel, CompiledKernel) and runs == 1:
            one, _, table = kernel.address
            given, found = self.all_given.ctypes.data, self.all_found.ctypes.data
            self.run: Any = partial(ONE_SAMPLE(one), table, given, found)
        else:
            self.run = self._run

    @staticmethod
    def of(models: Sequence[Model], question: str, *details: Any) -> KernelColumns:
        """Columns of runs of models: where numbers differ, each run has its own in more rows."""
        systems = [model.system for model in models]
        if all(system is systems[0] for system in systems):
            return KernelColumns(models[0].kernel(question, *details), len(models))
        columns = KernelColumns(systems[0].family.numberless(question, *details), len(models))
        for name, values in number_ports(Numbers.joined([s.numbers for s in systems])).items():
            if columns.has(name):
                columns.fill(name, values)
        return columns

    def _rows(self, count: int) -> np.ndarray:
        found = aligned(count * self.stride).reshape(count, self.stride)
        found[:] = 0.0
        return found

    def _run(self) -> int:
        """Run by arrays, at the first run alone."""
        shapes = shapes_of(self.kernel.interface)
        ports = {
            name: self.given[self._ports[name], 0].reshape(1, *shape)
            for name, shape in shapes.items()
        }
        answer = self.kernel.run(ports)
        for name, rows in self._results.items():
            self.found[rows, 0] = answer.values[name].reshape(len(rows))
        return int(answer.status[0])

    def has(self, port: str) -> bool:
        """Whether there is an input of that name."""
        return port in self._ports

    def rows(self, port: str) -> np.ndarray:
        """Where an input stands."""
        return self._ports[port]

    def result(self, name: str) -> np.ndarray:
        """Where a result stands; none where there is no such result."""
        return self._results.get(name, np.zeros(0, dtype=int))

    def give(self, port: str, value: Any, run: int = 0) -> None:
        """Set an input of one run."""
        self.given[self._ports[port], run] = value

    def fill(self, port: str, values: Any) -> None:
        """Set an input of all runs: a value for each, or one for all."""
        self.given[self._ports[port]] = np.reshape(values, (len(values), -1)).T

    def __getitem__(self, name: str) -> np.ndarray:
        """A result of the first run at the last evaluation, anew."""
        return self.found[self._results[name], 0]

    def address(self, row: int, found: bool = False) -> int:
        """The address of a row's numbers."""
        rows = self.all_found if found else self.all_given
        return rows[row:].ctypes.data

    def pointers(self) -> tuple[Any, Any]:
        """Addresses of all input rows, and the step within each, as `batch` takes them."""
        count = self.kernel.interface.columns
        at = (ctypes.c_void_p * count)(*(self.address(row) for row in range(count)))
        return at, (ctypes.c_ssize_t * count)(*[1] * count)
