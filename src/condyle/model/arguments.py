"""What a model takes: arrays of any leading shape, a wrench and the point where it acts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, did_you_mean, shown
from ..mechanism.mechanism import COORDINATES

Array = np.ndarray
Lead = tuple[int, ...]
NO_WRENCH, ORIGIN = np.zeros(6), np.zeros(3)


class Argument(NamedTuple):
    """An array (..., size) of numbers: its name, and its entries in words."""

    name: str
    size: int
    entries: str

    def array(self, given: Any) -> Array:
        """As doubles.

        Raises: InputError: for anything but an array of numbers of this shape.
        """
        found = given if type(given) is np.ndarray else self.numbers(given)
        if found.dtype != np.float64:
            found = self.numbers(found)
        if not found.ndim or found.shape[-1] != self.size:
            raise self._refused(f"shape {found.shape}" if found.ndim else _described(given))
        return found

    def numbers(self, given: Any) -> Array:
        """As doubles, of any shape."""
        try:
            found = np.asarray(given)
            if found.dtype.kind == "O" and any(x is None for x in found.flat):
                raise TypeError
            if found.dtype.kind not in "fiubO":
                raise TypeError
            return found.astype(float)
        except (TypeError, ValueError, OverflowError):  # ragged lists, words, objects
            raise self._refused(_described(given)) from None

    def _refused(self, got: str) -> InputError:
        shape = f"(..., {self.size})"
        return InputError(
            f"{self.name}: expected numbers in an array of shape {shape}: {self.entries}; got {got}"
        )


WRENCH = Argument("wrench", 6, "Fx, Fy, Fz [N], Mx, My, Mz [N m] in {S}")
POINT = Argument("at", 3, "x, y, z [m] in {M}, or the name of a platform point")
POSE = Argument("pose", 6, f"{', '.join(COORDINATES)} [m, rad]")
# Where a motion gives more than states: of `Structure.given`.
GIVEN = {
    "gravity": Argument("gravity", 3, "gx, gy, gz [m/s^2] in {S}"),
    "base": Argument(
        "base", 9, "the base's acceleration [m/s^2], angular velocity [rad/s] and angular "
        "acceleration [rad/s^2], x, y, z of each in {S}"
    ),
}  # fmt: skip
NOTHING: Mapping[str, Any] = {}


def given_of(gravity: Any, base: Any) -> Mapping[str, Any]:
    """Those of `GIVEN` that are given."""
    return {n: a for n, a in (("gravity", gravity), ("base", base)) if a is not None}


PORTS = {"v": "q1", "a": "q2"}  # names of questions, where they are others


class Arguments:
    """Of one mechanism: states, efforts or joints, wrenches and where they act."""

    def __init__(
        self,
        independent: Sequence[str],
        chains: Sequence[str],
        points: Mapping[str, tuple[float, float, float]],
    ) -> None:
        entries, m, n = ", ".join(independent), len(independent), len(chains)
        self.q = Argument("q", m, f"{entries} [m, rad]")
        self.v = Argument("v", m, f"rates of {entries} [m/s, rad/s]")
        self.a = Argument("a", m, f"accelerations of {entries} [m/s^2, rad/s^2]")
        self.effort = Argument("effort", n, f"{', '.join(chains)} [N m or N]")
        self.activation = Argument("activation", n, f"{', '.join(chains)}")
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
        found = [self.q.array(q), self.v.array(v), third.array(x), w, self.point(at)]
        for a, argument in zip(found, (self.q, self.v, third, WRENCH, POINT), strict=True):
            if a.ndim > 1:
                raise InputError(
                    f"{argument.name}: expected one state, an array of shape ({argument.size},): "
                    f"{argument.entries}; got shape {a.shape}"
                )
        return found

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
            raise InputError(f"outputs: there is no output {shown(name)}.{hint}")
    return names


def _described(given: Any) -> str:
    if isinstance(given, np.ndarray):
        return f"shape {given.shape}, dtype {given.dtype}"
    return f"{type(given).__name__} {shown(given)}"
