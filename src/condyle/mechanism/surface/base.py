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
from collections.abc import Callable, Mapping
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np

from ..quantities import NumberField, number_fields
from ..table import Table
from .freedom import Freedom

Foot = Callable[[Any], tuple[ca.SX, ca.SX, ca.SX]]  # numbers -> closest point, mu, unit normal
Scalar = Any  # a float or a CasADi scalar
Coordinates = Any  # anything with [0], [1], [2]


class Smooth(ABC):
    """What has an equation phi(point, constants), twice differentiable.

    known:   whether that equation is at hand.
    flat:    a plane whose constants are slope (2) and offset.
    by_numpy: whether phi takes arrays of points.
    numbers: of a file, of which `from_numbers` makes the constants.
    lifted:  whether `moved` takes it along Z; else along its normal.
    carrier: the number that moves it, by its name; without such a number home is not kept.

    A surface may also have, both static and of numbers f as `from_numbers` takes them:
    `beyond(f, distance)`, those of the parallel surface, where it is of the same kind; and
    `principal(f)`, the principal axes of a surface of second order, as of `ParallelQuadric`.
    """

    known: ClassVar[bool] = True
    flat: ClassVar[bool] = False
    by_numpy: ClassVar[bool] = False
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

    @staticmethod
    def room(f: Any) -> Any:
        """Radius of the largest ball that has room inside [m], of numbers f; None: any ball has."""
        return None

    @classmethod
    def moved(cls, f: Any, by: Any, normal: Any) -> Any:
        """Numbers f of the surface moved by a distance [m]: along Z, or a unit normal (3,)."""
        way = by if cls.lifted else by * normal
        return SimpleNamespace(**{**vars(f), cls.carrier: getattr(f, cls.carrier) + way})

    @staticmethod
    def nearest(f: Any, point: ca.SX, foot: Foot) -> tuple[ca.SX, ca.SX]:
        """Signed distance of a point from it [m], and the unit normal there, (3,), of numbers f."""
        w, _, n = foot(f)
        return ca.dot(n, point - w), n

    @property
    def curved_alike(self) -> bool:
        """Whether all its directions are principal ones, which then have no derivative."""
        return False

    def joints(self, point: np.ndarray, normal: np.ndarray) -> tuple[Freedom, ...] | None:
        """Joints that keep a point on it exactly, if there are such. Args: at home, (3,) each."""
        return None

    def level_directions(self) -> np.ndarray | None:
        """Level u and v, (2, 2), over which its height is g(u) + h(v); None: seen from its normal
        it nearly is, over the directions of principal curvature."""
        return None

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
            part = ca.reshape(part, 3, 3).T if hasattr(part, "numel") else part.reshape(3, 3)
        values[name] = part[0] if count == 1 else part
        start += count
    return SimpleNamespace(**values)


@lru_cache(maxsize=64)
def _derivation(kind: Any, method: str, sizes: tuple[tuple[str, int], ...]) -> ca.Function:
    given = ca.SX.sym("f", sum(count for _, count in sizes))
    found = getattr(kind, method)(named(given, dict(sizes)))
    return ca.Function(method, [given], [ca.densify(found)])


class SurfaceTable(Smooth, Table):
    """A surface of a file: its `kind`, numbers and `equation`; `closed` around an inside.

    A kind that needs other constants than its numbers has `from_numbers` and `phi` instead.
    """

    kind: str
    closed: ClassVar[bool] = False

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        cls.numbers = number_fields(cls)

    @staticmethod
    def equation(point: Coordinates, f: Any) -> Scalar:
        """phi at a point (3,), from the numbers of the file by name, SI: floats or symbols."""
        raise NotImplementedError

    def phi(self, point: Coordinates, constants: Coordinates | None = None) -> Scalar:
        c = self.constants() if constants is None else constants
        sizes = {name: own.size for name, own in self.numbers.items()}
        return self.equation(point, named(c if hasattr(c, "numel") else np.array(c), sizes))

    @staticmethod
    def from_numbers(f: Any) -> ca.SX:
        return ca.vertcat(*(ca.vec(ca.SX(x).T) for x in vars(f).values()))

    def at_distance(self, distance: float) -> Any:
        if (beyond := getattr(self, "beyond", None)) is None:
            return None
        return self._with_numbers(beyond(self._named(), distance))

    def moved_by(self, distance: float, normal: np.ndarray) -> Self:
        """The surface as `moved`."""
        return self._with_numbers(self.moved(self._named(), distance, ca.DM(normal)))

    def _named(self) -> SimpleNamespace:
        return named(ca.DM(self.own_numbers()), self.sizes())

    def _with_numbers(self, f: Any) -> Self:
        shapes = {name: np.shape(getattr(self, name)) for name in vars(f)}
        each = {name: np.array(ca.DM(x)).reshape(shapes[name]) for name, x in vars(f).items()}
        return self.derived(**{name: _tuples(x.tolist()) for name, x in each.items()})

    @property
    def form(self) -> str:
        """Surfaces of one form and one number of constants share one expression phi."""
        return self.kind

    @classmethod
    def of_form(cls, form: str) -> Self:
        """A surface of a form, without numbers."""
        return cls.model_construct()


def _tuples(x: Any) -> Any:
    return tuple(map(_tuples, x)) if isinstance(x, list) else x


def sides(closed: bool) -> tuple[str, str]:
    """Names of the two sides of a surface: against its normal, and along it."""
    return ("inside", "outside") if closed else ("below", "above")
