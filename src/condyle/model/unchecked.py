"""One state after the other through a compiled kernel, at least latency: for control loops.

A kernel takes some 0.1 us, so that every step around it counts: where numbers go, and how the
kernel is called, is prepared once a thread.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from functools import cached_property
from typing import Any, Self

import numpy as np

from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.kernel import OK
from .arguments import NO_WRENCH, NOTHING, ORIGIN, Argument, Arguments, Lead, requested
from .model_result import ModelResult
from .system import System

ALL = slice(None)
ALWAYS = frozenset({"contact", "bound"})  # what both questions are asked, whatever is wanted
Call = Callable[..., Any]


class Unchecked:
    """Inverse and forward dynamics of one state, at least latency; see `Model.unchecked`."""

    def __init__(self, inverse: Callable[[], Dynamics], forward: Callable[[], Dynamics]) -> None:
        self._inverse, self._forward = inverse, forward

    def __repr__(self) -> str:
        return (
            "Dynamics of one state at least latency:\n"
            "  inverse_dynamics(q, v, a, wrench=None, at=None)       effort\n"
            "  forward_dynamics(q, v, effort, wrench=None, at=None)  acceleration"
        )

    @cached_property
    def inverse_dynamics(self) -> Call:
        return self._inverse().unchecked()

    @cached_property
    def forward_dynamics(self) -> Call:
        return self._forward().unchecked()


class Dynamics:
    """Inverse or forward dynamics of one mechanism: of one state here, of many where it is called.

    results: the first result, the contact forces and the bound.
    outputs: what may be asked for besides, and what the question is asked for each.
    third:   the argument behind q and v.
    """

    results: tuple[str, str, str]
    outputs: Mapping[str, str]

    def __init__(self, system: System, arguments: Arguments, third: Argument) -> None:
        self._system, self._arguments = system, arguments
        self.third: Argument = third
        self._under: dict[tuple[str, ...], Self] = {}

    def __call__(
        self,
        q: Any,
        v: Any,
        x: Any,
        wrench: Any,
        at: Any,
        outputs: Any,
        threads: int | None,
        given: Mapping[str, Any] = NOTHING,
    ) -> ModelResult:
        """As `Model.inverse_dynamics` and `Model.forward_dynamics`; given: of `GIVEN`."""
        if given:
            return self.many((q, v, x), wrench, at, outputs, threads, given)
        if type(q) is np.ndarray and q.ndim == 1 and not outputs and threads is None:
            row = self._one(q, v, x, wrench, self._arguments.point(at))
            if row is not None:
                first = len(row) - (7 - len(q))  # then the contact forces, and the bound
                parts = row[:first], row[first:-1], row[-1]
                found = dict(zip(self.results, parts, strict=True))
                return ModelResult(**found, status=np.zeros((), np.uint8))
        return self.many((q, v, x), wrench, at, outputs, threads)

    def many(
        self,
        state: Any,
        wrench: Any,
        at: Any,
        outputs: Any,
        threads: int | None,
        given: Mapping[str, Any] = NOTHING,
    ) -> ModelResult:
        """The same of arrays of any leading shape; state: q, v and the third argument."""
        names = requested(outputs, self.outputs)
        arguments = self._arguments.q, self._arguments.v, self.third
        lead, inputs = self._arguments.samples(arguments, state, wrench, at, given)
        return self.under(given)._solved(lead, inputs, names, threads)

    def under(self, given: Iterable[str]) -> Self:
        """The same of samples that give these of `GIVEN` too."""
        names = tuple(given)
        if not names:
            return self
        if names not in self._under:
            other = copy(self)
            other.__dict__.pop("_one", None)
            other._system, other._under = self._system.under(names), {}
            self._under[names] = other
        return self._under[names]

    def _solved(
        self, lead: Lead, inputs: dict[str, np.ndarray], names: tuple[str, ...], threads: int | None
    ) -> ModelResult:
        """Of samples by port; names: of outputs."""
        raise NotImplementedError

    def question(self, whole: bool) -> tuple[tuple[Any, ...], Mapping[str, np.ndarray]]:
        """The question of one state with its details, if a kernel alone can answer it, and its
        ports that are always given the same.

        Args: whole: whether contact forces and the bound are wanted too.
        """
        raise NotImplementedError

    @cached_property
    def _one(self) -> Call:
        """The results of one state in a row; None for anything else."""
        return self._bound(self.results, lambda *given: None)

    def unchecked(self) -> Call:
        """As `Model.unchecked`."""

        def checked(q: Any, v: Any, x: Any, wrench: Any = None, at: Any = None) -> np.ndarray:
            *state, wrench, at = self._arguments.state(self.third, q, v, x, wrench, at)
            found: np.ndarray = getattr(self.many(state, wrench, at, (), None), self.results[0])
            return found

        return self._bound(self.results[:1], checked)

    def _bound(self, results: tuple[str, ...], otherwise: Call) -> Call:
        question, fixed = self.question(results == self.results)
        # A kernel does not see a ball overlap its surface.
        alone = self._system.backend.name == "compiled" and not self._system.may_overlap
        compiled = question and alone
        kernel = self._system.kernel(*question) if compiled else None
        if not isinstance(kernel, CompiledKernel):
            return otherwise
        return bound(kernel, self._arguments.q.size, results, otherwise, fixed)


def bound(
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
    mine = threading.local()
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
        mine.single, mine.places = single, (*views, lanes, given, single.run, single.found)
        return mine.places

    def call(q: Any, v: Any, third: Any, wrench: Any = None, at: Any = None) -> Any:
        try:
            places = mine.places
        except AttributeError:
            places = prepare()
        to_q, to_v, to_third, to_wrench, to_point, lanes, given, run, found = places
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
            return found[wanted]
        return otherwise(q, v, third, wrench, at)

    return call


def _columns(kernel: CompiledKernel, results: tuple[str, ...]) -> np.ndarray:
    """Where results stand in the row of all, lanes in the order of the file."""
    face, found, row = kernel.interface, dict[str, np.ndarray](), 0
    for r in face.results:
        columns = np.arange(row, row + face.width(r))
        found[r.name] = columns[np.argsort(kernel.order)] if r.lanes else columns
        row += len(columns)
    return np.concatenate([found[name] for name in results])
