"""What every contact surface is: an equation phi(p) = 0 of a point p in {S}.

phi is distance-like: in metres, with a gradient of order 1 that points along the unit normal of
the file format, upwards for surfaces z = f(x, y), outwards for closed ones. Its numbers are its
second argument, so that one expression serves every surface of a kind; it is written with
operations that numbers and CasADi symbols share and never branches on a number, so that exact
derivatives come from CasADi.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from ..quantities import NumberField, number_fields
from ..table import Table

Scalar = Any  # a float or a CasADi scalar
Coordinates = Any  # anything with [0], [1], [2]


class Smooth(ABC):
    """What has an equation phi(point, constants), twice differentiable.

    known:   whether that equation is at hand.
    numbers: of a file, of which `from_numbers` makes the constants.
    lifted:  whether an offset along Z brings it to a point; else its centre moves.
    carrier: the number that does, by its name.
    """

    known: ClassVar[bool] = True
    numbers: ClassVar[Mapping[str, NumberField]] = {}
    lifted: ClassVar[bool] = True
    carrier: ClassVar[str] = "offset"

    @abstractmethod
    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        """How far a point (3,) is off the surface [m], positive along the normal.

        Args: constants: `constants()` of this or another surface of the kind; default: its own.
        """

    def constants(self) -> tuple[float, ...]:
        """The numbers of the equation, SI."""
        return self.derive("from_numbers")

    def derive(self, method: str) -> tuple[float, ...]:
        """What a static method of its kind makes of its numbers in a file."""
        found = _derivation(type(self), method, tuple(self.sizes().items()))
        return tuple(map(float, found(self.own_numbers()).nonzeros()))

    @staticmethod
    @abstractmethod
    def from_numbers(f: Any) -> ca.SX:
        """The numbers of the equation from those of the file. Args: f: `named` numbers."""

    @staticmethod
    def sound(f: Any) -> list[ca.SX]:
        """Truth values that its numbers together have to have: see `from_numbers`."""
        return []

    def sizes(self) -> dict[str, int]:
        """Names of its numbers in a file and how many each is."""
        return {name: int(np.size(getattr(self, name))) for name in self.numbers}

    def own_numbers(self) -> list[float]:
        """Its numbers in a file, one after another, SI."""
        return [float(x) for name in self.numbers for x in np.ravel(getattr(self, name))]

    def at_distance(self, distance: float) -> Any:
        """The parallel surface at a signed distance [m], if it is one of the same kind."""
        return None

    def bends(self, constants: Any) -> tuple[float, float]:
        """Bounds of the eigenvalues of phi's second derivative anywhere [1/m], where known."""
        return -math.inf, math.inf

    def gradient(self, point: ca.SX, constants: Any = None) -> ca.SX:
        """d phi / d point, (3,): along the unit normal."""
        p = ca.SX.sym("p", 3)
        return ca.substitute(ca.gradient(self.phi(p, constants), p), p, point)

    def bending(self, point: ca.SX, velocity: ca.SX, constants: Any = None) -> ca.SX:
        """v^T (d2 phi / d point2) v: what phi'' owes to a velocity, (3,), alone."""
        p = ca.SX.sym("p", 3)
        change = ca.jtimes(ca.gradient(self.phi(p, constants), p), p, velocity)
        return ca.dot(ca.substitute(change, p, point), velocity)

    def rounded(self, point: ca.SX, constants: Any) -> ca.SX:
        """How much rounding of its numbers changes the second derivative there [1/m], over
        that rounding; only where it is many times more than the derivative itself.
        """
        return ca.SX(0)

    def started_at(self, point: ca.SX, constants: Any = None) -> Smooth:
        """The surface for points near `point`, which need not search as far as any point would.

        It is the less exact the farther they are; it may be this surface itself.
        """
        return self


def named(vector: Any, sizes: Mapping[str, int]) -> SimpleNamespace:
    """Numbers by name, from all of them one after another; nine are a matrix, row by row."""
    values, start = {}, 0
    for name, count in sizes.items():
        part = vector[start : start + count]
        if count == 9:
            part = ca.reshape(part, 3, 3).T if isinstance(part, ca.SX) else part.reshape(3, 3)
        values[name] = part[0] if count == 1 else part
        start += count
    return SimpleNamespace(**values)


@lru_cache(maxsize=64)
def _derivation(kind: Any, method: str, sizes: tuple[tuple[str, int], ...]) -> ca.Function:
    given = ca.SX.sym("f", sum(count for _, count in sizes))
    found = getattr(kind, method)(named(given, dict(sizes)))
    return ca.Function(method, [given], [ca.densify(found)])


class SurfaceTable(Smooth, Table):
    """A surface of a mechanism file: its `kind`, and whether it is `closed` around an inside."""

    kind: str
    closed: ClassVar[bool] = False
    numbers: ClassVar[Mapping[str, NumberField]]

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        cls.numbers = number_fields(cls)

    def at_distance(self, distance: float) -> Any:
        if (beyond := getattr(self, "beyond", None)) is None:
            return None
        f = vars(beyond(named(ca.DM(self.own_numbers()), self.sizes()), distance))
        each = {name: np.asarray(x).ravel().tolist() for name, x in f.items()}
        return self.derived(**{n: tuple(x) if len(x) > 1 else x[0] for n, x in each.items()})

    @property
    def form(self) -> str:
        """Surfaces of one form and one number of constants share one expression phi."""
        return self.kind


def sides(closed: bool) -> tuple[str, str]:
    """Names of the two sides of a surface: against its normal, and along it."""
    return ("inside", "outside") if closed else ("below", "above")
