"""One state after the other through a compiled kernel, at least latency: for control loops.

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
from ..backends.kernel import OK
from .arguments import NO_WRENCH, ORIGIN

ALL = slice(None)
Call = Callable[..., Any]


class Unchecked(threading.local):
    """Inverse and forward dynamics of one state, at least latency; see `Model.unchecked`.

    Every thread has buffers of its own, so one object serves all threads.
    """

    inverse_dynamics: Call
    forward_dynamics: Call

    def __init__(self, **prepare: Callable[[], Call]) -> None:
        """Args: prepare: what makes each of the functions, when a thread first asks for it."""
        self._prepare = prepare

    def __getattr__(self, name: str) -> Call:
        if name not in ("inverse_dynamics", "forward_dynamics"):
            raise AttributeError(f"unchecked() has no {name!r}: inverse_dynamics, forward_dynamics")
        call = self._prepare[name]()
        setattr(self, name, call)
        return call


def bound(
    kernel: CompiledKernel,
    size: int,
    results: tuple[str, ...],
    otherwise: Call,
    fixed: Mapping[str, np.ndarray] = MappingProxyType({}),
) -> Call:
    """A compiled kernel as a function of q, v, a third array, wrench and point, each of one state.

    Args:    size: of q and v;  results: those wanted, in one row;  fixed: what other ports are
             always given.
             otherwise: is called with the same arguments where they are not doubles of the right
             number, or the kernel has no answer.
    Returns: the function; its result is a new array.
    """
    single, order = kernel.single(), np.array(kernel.order)
    for port in kernel.interface.ports:
        if port.name in fixed:
            row = fixed[port.name][order if port.lanes else ALL]
            single.given[port.start : port.start + len(row)] = row
    third = kernel.interface.ports[2]
    sizes = np.cumsum([size, size, kernel.interface.lanes if third.lanes else size, 6, 3])
    places = np.split(single.given[: sizes[-1]], sizes[:-1])
    lanes, moved = places[2], third.lanes and (np.diff(order) < 0).any()
    if moved:
        places[2] = np.empty_like(lanes)
    return _call(
        single, places, lanes if moved else None, order, _columns(kernel, results), otherwise
    )


def _columns(kernel: CompiledKernel, results: tuple[str, ...]) -> np.ndarray:
    """Where results stand in the row of all, lanes in the order of the file."""
    face, found, row = kernel.interface, dict[str, np.ndarray](), 0
    for r in face.results:
        columns = np.arange(row, row + face.width(r))
        found[r.name] = columns[np.argsort(kernel.order)] if r.lanes else columns
        row += len(columns)
    return np.concatenate([found[name] for name in results])


def _call(
    single: Single,
    places: list[np.ndarray],
    lanes: np.ndarray | None,
    order: np.ndarray,
    wanted: np.ndarray,
    otherwise: Call,
) -> Call:
    # Memoryviews take doubles, as many as there are places; arrays would stretch a single one.
    to_q, to_v, to_third, to_wrench, to_point = (memoryview(a) for a in places)  # type: ignore[arg-type]
    run, found = single.run, single.found
    nothing: Any = NO_WRENCH
    origin: Any = ORIGIN

    def call(q: Any, v: Any, third: Any, wrench: Any = None, at: Any = None) -> Any:
        try:
            to_q[ALL] = q
            to_v[ALL] = v
            to_third[ALL] = third
            to_wrench[ALL] = nothing if wrench is None else wrench
            to_point[ALL] = origin if at is None else at
        except (TypeError, ValueError, NotImplementedError):
            return otherwise(q, v, third, wrench, at)
        if lanes is not None:
            lanes[:] = places[2][order]
        if run() == OK:
            return found[wanted]
        return otherwise(q, v, third, wrench, at)

    call.single = single  # type: ignore[attr-defined]  # has to stay as long as it is called
    return call
