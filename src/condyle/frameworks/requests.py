"""What frameworks ask of a model: questions by ports, as kernels for values and for derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from ..backends.kernel import Kernel, places_of, shapes_of
from ..errors import UnsupportedError
from ..graph.program import Program, Programs
from ..graph.transform import numbers_as_ports
from ..model.derivatives import FORWARD, INVERSE, PORTS
from ..model.model import Model
from ..model.system import System
from ..questions import Question
from ..questions.friction import MOST
from ..questions.numbers import Layout

Details = tuple[Any, ...]


@dataclass(frozen=True)
class Request:
    """A question of a model.

    system:    of the model; with all numbers, if some of them are arguments.
    arguments: names as functions have them, and the ports that each is, in turn.
    results:   of the question, in the order of rows.
    """

    system: System
    question: str
    details: Details
    arguments: tuple[tuple[str, tuple[str, ...]], ...]
    results: tuple[str, ...]
    numbered: bool = False

    def written(self, *question: Any) -> Program:
        """A question's robust program, with the mechanism's numbers as ports if they are asked."""
        found = Question.about(self.system.structure, *question).variants()
        program = found.robust or found.main
        sizes = Layout.of(self.system.structure).sizes
        return numbers_as_ports(program, *sizes) if self.numbered else program

    def kernel(self, *question: Any) -> Kernel:
        """The kernel of a question; of `written` if numbers are asked."""
        if not self.numbered:
            return self.system.kernel(*question)
        key = Question.about(self.system.structure, *question).with_ports().key
        build = lambda: Programs(self.written(*question))  # noqa: E731
        key = None if key is None else f"{key} robust"
        return self.system.backend.kernel(key, build, self.system.numbers)

    @cached_property
    def values(self) -> Kernel:
        return self.kernel(self.question, *self.details)

    @cached_property
    def ports(self) -> tuple[str, ...]:
        return tuple(port for _, ports in self.arguments for port in ports)

    @cache  # noqa: B019  (a model's own)
    def slopes(self, ports: tuple[str, ...]) -> Kernel:
        """The kernel of derivatives of all results by some ports, `<result>/<port>`."""
        return self.derivative("slopes", ports)

    def derivative(self, how: str, by: tuple[str, ...]) -> Kernel:
        """Derivatives of all results by some ports: see `questions.derivative`."""
        return self.kernel("derivative", how, self.question, self.details, by, self.results)

    def matrix(self, result: str, port: str, slopes: Any) -> Any:
        """Derivatives as a kernel has them, (..., result, port)."""
        face = self.values.interface
        if next(p.lanes for p in face.ports if p.name == port):
            return slopes[..., 0, :]
        of_lanes = next(r.lanes for r in face.results if r.name == result)
        return slopes.swapaxes(-1, -2) if of_lanes else slopes

    def sizes(self) -> dict[str, int]:
        """Numbers of every port."""
        shapes = shapes_of(self.values.interface)
        return {port: int(np.prod(shapes[port])) for port in self.ports}


def dynamics(model: Model, numbered: bool = False) -> dict[str, Request]:
    """Inverse and forward dynamics.

    Args:   numbered: whether numbers of the mechanism are arguments.
    Raises: UnsupportedError: for efforts within limits, or friction at many contacts.
    """
    if model.chooses_efforts:
        raise UnsupportedError(
            f'efforts of "{model.distribution.name}" have no function here: only those of least '
            'norm have. Take model.with_distribution("minimum_norm")'
        )
    if len(model.system.structure.friction) > MOST:
        raise UnsupportedError(f"friction at more than {MOST} contacts has no function here")
    system = model.system.unreduced if numbered else model.system
    requests = {}
    for question, kind in (("inverse", INVERSE), ("forward", FORWARD)):
        arguments = tuple((name, PORTS[name]) for name in (*kind.needs, "wrench", "at"))
        requests[f"{question}_dynamics"] = Request(
            system, question, (("contact",),), arguments, kind.of, numbered
        )
    return requests


def inputs_of(
    kernel: Kernel, arguments: Sequence[tuple[str, Sequence[str]]]
) -> tuple[list[int], list[int]]:
    """Which argument every column of a kernel is part of, and where.

    Args: arguments: names and the ports that stand in each, in turn.
    """
    where: dict[str, tuple[int, int]] = {}
    ports = {port.name: port for port in kernel.interface.ports}
    sizes = {p.name: p.size * (len(kernel.order) if p.lanes else 1) for p in ports.values()}
    for i, (_, own) in enumerate(arguments):
        where |= {port: (i, sum(sizes[p] for p in own[:j])) for j, port in enumerate(own)}
    argument, entry = list[int](), list[int]()
    for port in kernel.interface.ports:
        at, first = where[port.name]
        places = [*range(port.size)]
        if port.lanes:
            places = [i * len(kernel.order) + k for i in range(port.size) for k in kernel.order]
        argument += [at] * len(places)
        entry += [first + k for k in places]
    return argument, entry


@dataclass(frozen=True)
class ResultColumns:
    """Where the columns of a kernel go: which result, the place in its row; results' shapes."""

    result: tuple[int, ...]
    place: tuple[int, ...]
    shapes: dict[str, tuple[int, ...]]

    @staticmethod
    def of(kernel: Kernel) -> ResultColumns:
        """Lanes in the callers' order, last in a result's shape."""
        result: list[int] = []
        place: list[int] = []
        shapes = {}
        for i, (name, start, end, shape, moved) in enumerate(
            places_of(kernel.interface, kernel.order)
        ):
            at = np.arange(end - start).reshape(shape)
            to = np.empty(end - start, dtype=int)
            to[at if moved is None else at[..., moved]] = at
            result += [i] * len(to)
            place += to.tolist()
            shapes[name] = shape
        return ResultColumns(tuple(result), tuple(place), shapes)
