"""What a model takes: arrays of any leading shape, a wrench and the point where it acts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, brief, did_you_mean
from ..mechanism.mechanism import Mechanism
from ..motion.arrays import numbers_in
from ..quantities import QUANTITIES

Array = np.ndarray
Lead = tuple[int, ...]
NO_WRENCH, ORIGIN = np.zeros(6), np.zeros(3)


class Argument(NamedTuple):
    """An array (..., size) of numbers: its name, and the names and units of its entries.

    also: what tables call these entries, where it is something else.
    """

    name: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    also: tuple[str, ...] = ()
    where: str = ""

    @property
    def size(self) -> int:
        return len(self.names)

    @property
    def entries(self) -> str:
        """The entries in words."""
        return f"{', '.join(self.names)} [{', '.join(dict.fromkeys(self.units))}]{self.where}"

    def array(self, given: Any) -> Array:
        """As doubles; by the names of entries where they have any.

        Raises: InputError: for anything but an array of numbers of this shape.
        """
        values: Array | None = given
        if type(given) is not np.ndarray or given.dtype != np.float64:
            values = numbers_in(given, self.name, self.units, self.names, self.also)
        if values is None or not values.ndim or values.shape[-1] != self.size:
            got = (
                f"shape {values.shape}" if values is not None and values.ndim else _described(given)
            )
            raise InputError(
                f"{self.name}: expected numbers in an array of shape (..., {self.size}): "
                f"{self.entries}; got {got}"
            )
        return values


def _of(name: str, mechanism: Any = None, where: str = "") -> Argument:
    """The argument of a quantity; of a mechanism, where its entries are not the same of all."""
    quantity = QUANTITIES[name]
    labels = tuple(label for (label,) in quantity.labels(mechanism))
    columns, units = tuple(quantity.columns(mechanism)), quantity.units(mechanism)
    units = units * len(labels) if len(units) == 1 else units
    names, also = (labels, columns) if quantity.entries == ("chain",) else (columns, labels)
    return Argument(name, names, units, also, where)


WRENCH = _of("wrench", where=" in {S}")
POINT = _of("at", where=" in {M}, or the name of a platform point")
POSE = _of("pose")
# Where a motion gives more than states: of `Structure.given`.
GIVEN = {name: _of(name, where=" in {S}") for name in ("gravity", "base")}
NOTHING: Mapping[str, Any] = {}


def given_of(gravity: Any, base: Any) -> Mapping[str, Any]:
    """The arguments of `GIVEN` that are given."""
    return {n: a for n, a in (("gravity", gravity), ("base", base)) if a is not None}


PORTS = {"v": "q1", "a": "q2"}  # names of questions, where they are others


class Arguments:
    """A mechanism's arguments: states, efforts or joints, wrenches and where they act."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.q: Argument = _of("q", mechanism)
        self.v: Argument = _of("v", mechanism)
        self.a: Argument = _of("a", mechanism)
        self.effort: Argument = _of("effort", mechanism)
        self.joint: Argument = _of("joint", mechanism)
        also = tuple(f"activation_{name}" for name in mechanism.chain_names)
        self.activation: Argument = _of("activation", mechanism)._replace(also=also)
        points = mechanism.platform.points
        self._points = {name: np.array(point, dtype=float) for name, point in points.items()}

    def point(self, at: Any) -> Array:
        """Where a wrench acts, (..., 3) [m] in {M}: a platform point by its name, or coordinates;
        None is O_M.

        Raises: InputError: for an unknown platform point, or anything but coordinates.
        """
        if at is None:
            return ORIGIN
        if isinstance(at, str):
            if at not in self._points:
                hint = did_you_mean(at, self._points)
                raise InputError(f'at: the mechanism has no point "{at}".{hint}')
            return self._points[at]
        return POINT.array(at)

    def state(self, third: Argument, q: Any, v: Any, x: Any, wrench: Any, at: Any) -> list[Array]:
        """q, v and a third argument of one state, (size,) each, its wrench and point.

        Raises: InputError: for anything but one state.
        """
        w = NO_WRENCH if wrench is None else WRENCH.array(wrench)
        arrays = [self.q.array(q), self.v.array(v), third.array(x), w, self.point(at)]
        for a, argument in zip(arrays, (self.q, self.v, third, WRENCH, POINT), strict=True):
            if a.ndim > 1:
                raise InputError(
                    f"{argument.name}: expected one state, an array of shape ({argument.size},): "
                    f"{argument.entries}; got shape {a.shape}"
                )
        return arrays

    def samples(
        self,
        arguments: Sequence[Argument],
        given: Sequence[Any],
        wrench: Any,
        at: Any,
        more: Mapping[str, Any] = NOTHING,
    ) -> tuple[Lead, dict[str, Array]]:
        """The leading shape, and what questions take: states and load by port, see `samples`.

        Args: more: of `GIVEN`.
        """
        w = NO_WRENCH if wrench is None else WRENCH.array(wrench)
        if more:
            arguments = (*arguments, *(GIVEN[name] for name in more))
            given = (*given, *more.values())
        arrays = [argument.array(a) for argument, a in zip(arguments, given, strict=True)]
        lead, flat = samples((*arguments, WRENCH, POINT), [*arrays, w, self.point(at)])
        ports = {PORTS.get(a.name, a.name): x for a, x in zip(arguments, flat, strict=False)}
        w = flat[-2]
        return lead, ports | {"force": w[:, :3], "moment": w[:, 3:], "point": flat[-1]}


def samples(arguments: Sequence[Argument], arrays: Sequence[Array]) -> tuple[Lead, list[Array]]:
    """The common leading shape of arrays (..., size), and each with samples as rows: (N, size), or
    (1, size) where it is the same for all.

    Raises: InputError: for leading shapes that do not go together.
    """
    leads = {a.shape[:-1] for a in arrays if a.ndim > 1}
    lead = next(iter(leads), ())
    if len(leads) > 1:
        try:
            lead = np.broadcast_shapes(*leads)
        except ValueError:
            shapes = (f"{x.name} {a.shape}" for x, a in zip(arguments, arrays, strict=True))
            raise InputError(
                f"the leading shapes do not go together: {', '.join(shapes)}; give each one state, "
                "or as many as the others"
            ) from None
    flat = []
    for a in arrays:
        if a.ndim == 1 and 0 not in lead:
            flat.append(a[None])
        elif a.ndim == 2 and len(lead) == 1 and a.shape[:1] == lead:
            flat.append(a)
        else:
            flat.append(np.broadcast_to(a, (*lead, a.shape[-1])).reshape(-1, a.shape[-1]))
    return lead, flat


def requested(outputs: Any, known: Collection[str]) -> tuple[str, ...]:
    """Names of outputs, of those that are known; "all" is all.

    Raises: InputError: for unknown names.
    """
    try:
        names = (outputs,) if isinstance(outputs, str) else tuple(outputs)
    except TypeError:
        raise InputError(f"outputs: expected names, got {_described(outputs)}") from None
    if "all" in names:
        return tuple(known)
    for name in names:
        if name not in known:
            hint = did_you_mean(name, (*known, "all"))
            raise InputError(f"outputs: unknown output {brief(name)}.{hint}")
    return names


def _described(given: Any) -> str:
    if isinstance(given, np.ndarray):
        return f"shape {given.shape}, dtype {given.dtype}"
    return f"{type(given).__name__} {brief(given)}"
