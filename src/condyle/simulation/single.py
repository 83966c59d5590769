"""One evaluation of a question after the other, whichever backend runs it."""

from __future__ import annotations

import math

import numpy as np

from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.kernel import Kernel
from ..graph.program import Interface, Result


class Single:
    """A kernel bound to places of its own: give arrays port by port, find results by name.

    Results are views that the next call overwrites; lanes stand first in each: (n,) or (n, ...).
    """

    def __init__(self, kernel: Kernel) -> None:
        self._kernel, face = kernel, kernel.interface
        self._ports = face.ports
        self._compiled = isinstance(kernel, CompiledKernel)
        if isinstance(kernel, CompiledKernel):
            self._single = kernel.single()
            self._given = [_columns(face, i, kernel.order) for i in range(len(face.ports))]
            self._found, start = {}, 0
            for result in face.results:
                width = face.width(result)
                block = self._single.found[start : start + width]
                self._found[result.name] = _placed(face, result, block, kernel.order)
                start += width

    def __call__(self, *inputs: np.ndarray) -> int:
        """Evaluate; returns the status. Lane ports take (n,), in the callers' order."""
        if self._compiled:
            given = self._single.given
            for place, value in zip(self._given, inputs, strict=True):
                given[place] = value
            return self._single.run()
        rows = {
            port.name: np.asarray(value, dtype=float)[None]
            for port, value in zip(self._ports, inputs, strict=True)
        }
        answer = self._kernel.run(rows)
        self._values = {
            name: np.moveaxis(a[..., 0], -1, 0)
            if _lanes(self._kernel.interface, name)
            else a[..., 0]
            for name, a in answer.values.items()
        }
        return int(answer.status[0])

    def __getitem__(self, name: str) -> np.ndarray:
        """A result of the last call."""
        if not self._compiled:
            return self._values[name]
        block, order = self._found[name]
        return block if order is None else block[order]


def _lanes(face: Interface, name: str) -> bool:
    return next(r.lanes for r in face.results if r.name == name)


def _columns(face: Interface, port: int, order: tuple[int, ...]) -> slice | np.ndarray:
    """Where the numbers of a port stand among the columns."""
    p = face.ports[port]
    if not p.lanes:
        return slice(p.start, p.start + p.size)
    where = np.empty(face.lanes, dtype=int)
    where[list(order)] = p.start + np.arange(face.lanes)
    return where


def _placed(
    face: Interface, result: Result, block: np.ndarray, order: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray | None]:
    """A view of a result's numbers, and how its lanes are to be sorted."""
    if not result.lanes:
        return block.reshape(result.shape), None
    starts = np.cumsum([0, *face.counts])
    mine = [k for g in result.groups for k in order[starts[g] : starts[g + 1]]]
    rows = block.reshape(math.prod(result.shape), len(mine)).T
    rows = rows[:, 0] if not result.shape else rows
    return rows, None if mine == sorted(mine) else np.argsort(mine)
