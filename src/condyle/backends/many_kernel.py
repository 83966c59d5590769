"""A kernel on the numbers of several mechanisms of its structure, each with samples of its own."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from ..graph.program import Interface, ManyNumbers
from .c.compiled_kernel import CompiledKernel
from .kernel import NONE, Kernel, KernelValues, sample_rows

WHICH = "variant"  # the input that says whose numbers a sample takes


class ManyKernel:
    """Like a kernel, with one more input: `variant`, (N,), the mechanism of each sample.

    Samples of one mechanism are quickest side by side.
    """

    def __init__(self, kernel: Kernel, numbers: ManyNumbers) -> None:
        self._kernel, self._numbers = kernel, numbers
        self.name: str = kernel.name
        self.interface: Interface = kernel.interface
        self.order: tuple[int, ...] = kernel.order

    def run(
        self,
        inputs: Mapping[str, np.ndarray],
        threads: int | None = None,
        without: frozenset[str] = NONE,
    ) -> KernelValues:
        """As of `Kernel`."""
        which = inputs[WHICH]
        cuts = np.flatnonzero(np.diff(which, prepend=-1, append=-1))
        if isinstance(self._kernel, CompiledKernel):
            return self._kernel.run_each(self._numbers, which, cuts, inputs, threads, without)
        found = []
        for start, end in pairwise(cuts.tolist()):
            own = self._kernel.renumbered(self._numbers[int(which[start])])
            few = sample_rows(inputs, np.arange(start, end), len(which))
            found.append(own.run(few, threads, without))
        if not found:  # no samples at all
            return self._kernel.run({name: a[:0] for name, a in inputs.items()}, None, without)
        values = {
            name: np.concatenate([one.values[name] for one in found], axis=-1)
            for name in found[0].values
        }
        return KernelValues(values, np.concatenate([one.status for one in found]))
