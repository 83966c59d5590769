"""What frameworks ask of a model: questions by ports, as kernels for values and for derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from ..backends.kernel import Kernel, places_of, shapes_of
from ..errors import UnsupportedError
from ..model.model import Model
from ..questions.friction import MOST

Details = tuple[Any, ...]


@dataclass(frozen=True)
class Asked:
    """A question of a model.

    arguments: names as functions have them, and the ports that each is, in turn.
    results:   of the question, in the order of rows.
    """

    model: Model
    question: str
    details: Details
    arguments: tuple[tuple[str, tuple[str, ...]], ...]
    results: tuple[str, ...]

    @cached_property
    def values(self) -> Kernel:
        return self.model.kernel(self.question, *self.details)

    @cached_property
    def ports(self) -> tuple[str, ...]:
        return tuple(port for _, ports in self.arguments for port in ports)

    @cache  # noqa: B019  (a model's own)
    def slopes(self, ports: tuple[str, ...]) -> Kernel:
        """Of the derivatives of all results by some ports, `<result>/<port>`."""
        asked = "slopes", self.question, self.details, ports, self.results
        return self.model.kernel("derivative", *asked)

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


def dynamics(model: Model) -> dict[str, Asked]:
    """Inverse and forward dynamics.

    Raises: UnsupportedError: for efforts within limits, or friction at many contacts.
    """
    if model.chooses_efforts:
        raise UnsupportedError(
            f'efforts of "{model.distribution.name}" have no function here: only those of least '
            'norm have. Take model.with_distribution("minimum_norm")'
        )
    if len(model.system.structure.friction) > MOST:
        raise UnsupportedError(f"friction at more than {MOST} contacts has no function here")
    wrench = ("wrench", ("force", "moment")), ("at", ("point",))
    state = ("q", ("q",)), ("v", ("q1",))
    return {
        "inverse_dynamics": Asked(
            model,
            "inverse",
            (("contact",),),
            (*state, ("a", ("q2",)), *wrench),
            ("effort", "contact_force"),
        ),
        "forward_dynamics": Asked(
            model,
            "forward",
            (("contact",),),
            (*state, ("effort", ("effort",)), *wrench),
            ("acceleration", "contact_force"),
        ),
    }


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
        i, first = where[port.name]
        lanes = kernel.order if port.lanes else range(port.size)
        argument += [i] * len(lanes)
        entry += [first + k for k in lanes]
    return argument, entry


@dataclass(frozen=True)
class Placed:
    """Where the columns of a kernel go: which result, the place in its row; results' shapes."""

    result: tuple[int, ...]
    place: tuple[int, ...]
    shapes: dict[str, tuple[int, ...]]

    @staticmethod
    def of(kernel: Kernel) -> Placed:
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
        return Placed(tuple(result), tuple(place), shapes)
