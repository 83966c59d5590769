"""One sample after the other through a compiled kernel, at least latency: for control loops.

A kernel takes some 0.1 us, so that every step around it counts: where numbers go, and how the
kernel is called, is prepared once a thread.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from ..backends.c.compiled_kernel import CompiledKernel, Single
from ..backends.kernel import AGAIN, OK
from .checks import Sample, as_samples

ALL = slice(None)


class OneByOne(threading.local):
    """A compiled kernel of q, q', a third array and the load.

    Attributes: call: what this thread calls. Takes arrays or lists; returns wanted results as a new
                array, NaN where there are none, or None where the robust path has to be asked;
                raises InputError for what is no sample.
    """

    def __init__(
        self,
        kernel: CompiledKernel,
        samples: tuple[Sample, ...],
        wanted: np.ndarray,
        fixed: Mapping[str, np.ndarray] = MappingProxyType({}),
    ) -> None:
        """Every thread comes through here when it first asks for `call`.

        Args: samples: what is given;  wanted: columns of the results, in order.
              fixed: what other ports are always given.
        """
        self._single = kernel.single()  # has to stay as long as it is called
        for port in kernel.interface.ports:
            if port.name in fixed:
                row = fixed[port.name][list(kernel.order) if port.lanes else slice(None)]
                self._single.given[port.start : port.start + len(row)] = row
        moved = kernel.interface.ports[2].lanes and kernel.order != tuple(sorted(kernel.order))
        order = np.array(kernel.order) if moved else None
        self.call = _bound(self._single, samples, wanted, order)


def _bound(
    single: Single, samples: tuple[Sample, ...], wanted: np.ndarray, order: np.ndarray | None
) -> Callable[[Any, Any, Any, Any], np.ndarray | None]:
    """Args: order: where the kernel's lanes stand in the third array, if elsewhere."""
    run, found = single.run, single.found
    ends = np.cumsum([sample.length for sample in samples])
    places = np.split(single.given[: ends[-1]], ends[:-1])
    lanes = places[2]
    if order is not None:
        places[2] = np.empty_like(lanes)
    # Memoryviews take doubles, as many as there are places; arrays would stretch a single one.
    to_q, to_q1, to_third, to_load = (memoryview(place) for place in places)  # type: ignore[arg-type]

    def call(q: Any, q1: Any, third: Any, load: Any) -> np.ndarray | None:
        try:
            to_q[ALL] = q
            to_q1[ALL] = q1
            to_third[ALL] = third
            to_load[ALL] = load
        except (TypeError, ValueError):  # lists, other numbers, or what does not fit
            return call(*as_samples(samples, q, q1, third, load))
        if order is not None:
            lanes[:] = places[2][order]
        status = run()
        if status == OK:
            return found[wanted]
        return None if status == AGAIN else np.full(len(wanted), np.nan)

    return call
