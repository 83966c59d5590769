"""One state after the other through a compiled kernel, at least latency: for control loops.

A kernel takes some 0.1 us, so that every step around it counts: where numbers go, and how the
kernel is called, is prepared once a thread.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.kernel import OK
from .arguments import NO_WRENCH, ORIGIN

ALL = slice(None)
Call = Callable[..., Any]


class Unchecked:
    """Inverse and forward dynamics of one state, at least latency; see `Model.unchecked`."""

    def __init__(self, inverse: Callable[[], Call], forward: Callable[[], Call]) -> None:
        self._inverse, self._forward = inverse, forward

    def __repr__(self) -> str:
        return (
            "Dynamics of one state at least latency:\n"
            "  inverse_dynamics(q, v, a, wrench=None, at=None)       effort\n"
            "  forward_dynamics(q, v, effort, wrench=None, at=None)  acceleration"
        )

    @cached_property
    def inverse_dynamics(self) -> Call:
        return self._inverse()

    @cached_property
    def forward_dynamics(self) -> Call:
        return self._forward()


def single_state_function(
    kernel: CompiledKernel,
    size: int,
    results: tuple[str, ...],
    otherwise: Call,
    fixed: Mapping[str, np.ndarray],
) -> Call:
    """A compiled kernel as a function of q, v, a third array, wrench and point, each of one state.

    Args:    size: of q and v;  results: those wanted, in one row;  fixed: what other ports are
             always given.
             otherwise: is called with the same arguments where they are not doubles of the right
             number, or the kernel has no answer.
    Returns: the function; its result is a new array. Every thread has buffers of its own.
    """
    order, face, wanted = np.array(kernel.order), kernel.interface, _columns(kernel, results)
    third = face.ports[2]
    sizes = np.cumsum([size, size, face.lanes if third.lanes else size, 6, 3])
    moved = third.lanes and (np.diff(order) < 0).any()
    own = threading.local()
    nothing: Any = NO_WRENCH
    origin: Any = ORIGIN

    def prepare() -> tuple[Any, ...]:
        single = kernel.single()
        for port in face.ports:
            if port.name in fixed:
                row = fixed[port.name][order if port.lanes else ALL]
                single.given[port.start : port.start + len(row)] = row
        places = np.split(single.given[: sizes[-1]], sizes[:-1])
        lanes = places[2]
        given = places[2] = np.empty_like(lanes) if moved else lanes
        # Memoryviews take doubles, as many as there are places; arrays would stretch a single one.
        views = (memoryview(a) for a in places)  # type: ignore[arg-type]
        own.single, own.places = single, (*views, lanes, given, single.run, single.outputs)
        return own.places

    def call(q: Any, v: Any, third: Any, wrench: Any = None, at: Any = None) -> Any:
        try:
            places = own.places
        except AttributeError:
            places = prepare()
        to_q, to_v, to_third, to_wrench, to_point, lanes, given, run, out = places
        try:
            to_q[ALL] = q
            to_v[ALL] = v
            to_third[ALL] = third
            to_wrench[ALL] = nothing if wrench is None else wrench
            to_point[ALL] = origin if at is None else at
        except (TypeError, ValueError, NotImplementedError):
            return otherwise(q, v, third, wrench, at)
        if moved:
            lanes[:] = given[order]
        if run() == OK:
            return out[wanted]
        return otherwise(q, v, third, wrench, at)

    return call


def _columns(kernel: CompiledKernel, results: tuple[str, ...]) -> np.ndarray:
    """Where results stand in the row of all, lanes in the order of the file."""
    face, by_name, row = kernel.interface, dict[str, np.ndarray](), 0
    for r in face.results:
        columns = np.arange(row, row + face.width(r))
        by_name[r.name] = columns[np.argsort(kernel.order)] if r.lanes else columns
        row += len(columns)
    return np.concatenate([by_name[name] for name in results])
