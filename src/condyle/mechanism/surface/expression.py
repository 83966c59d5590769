"""A surface written in Python: any CasADi expression of a point, and what a file keeps of one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, NoReturn

import casadi as ca

from ...errors import InputError
from ..quantities import NumberField, Unit
from .base import Smooth


@dataclass(frozen=True, eq=False)
class Expression(Smooth):
    """phi(p) = 0 for an expression of a point in {S}, taken once, when this is made.

        Expression(lambda p: p[2] - 0.01 * casadi.cos(40 * p[0]))

    phi is in metres, twice differentiable where the contact goes, with a gradient of order 1
    along the normal: upwards, or outwards where the surface is closed. It lives in Python only: a
    mechanism file names kinds and numbers, and nothing in it is evaluated.

    It can be pickled: what travels is the expression, not the function. Two are equal where their
    expressions are.

    Args:   function: (3,) SX -> scalar SX;  closed: whether the surface has an inside;
            offset: [m]: the surface is where phi(p) = offset.
    Raises: InputError: if `function` does not return a scalar expression of the point
            alone.
    """

    function: Callable[[ca.SX], Any]
    closed: bool = False
    offset: float = 0.0
    _equation: ca.Function = field(init=False, repr=False)

    kind: ClassVar[str] = "expression"
    numbers: ClassVar[Mapping[str, NumberField]] = {
        "offset": NumberField(Unit("m", most=math.inf), 1)
    }

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise InputError(f"a surface needs a function of a point, got {self.function!r}")
        if not isinstance(self.offset, int | float) or not math.isfinite(self.offset):
            raise InputError(f"offset: expected a finite number [m], got {self.offset!r}")
        p = ca.SX.sym("p", 3)
        value = self.function(p)
        if not isinstance(value, ca.SX) or value.shape != (1, 1):
            raise InputError(
                "a surface's function takes a point, a CasADi SX of 3 entries, and returns a "
                f"scalar SX; got {value!r}"
            )
        if any(not ca.depends_on(p, symbol) for symbol in ca.symvar(value)):
            raise InputError(
                "a surface's function returned an expression of other symbols than the point: "
                + ", ".join(str(symbol) for symbol in ca.symvar(value))
            )
        object.__setattr__(self, "_equation", ca.Function("phi", [p], [ca.densify(value)]))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Expression):
            return NotImplemented
        return self is other or self._what() == other._what()

    def __hash__(self) -> int:
        return hash(self._what())

    def _what(self) -> tuple[str, bool, float]:
        return self._serialized, self.closed, self.offset

    def __reduce__(self) -> tuple[Callable[..., Expression], tuple[str, bool, float]]:
        return _unpickled, self._what()

    def __deepcopy__(self, memo: Any) -> Expression:
        return self  # frozen

    @cached_property
    def _serialized(self) -> str:
        return self._equation.serialize()

    def phi(self, point: Any, constants: Any = None) -> Any:
        offset = self.offset if constants is None else constants[0]
        return self._equation(ca.vertcat(point[0], point[1], point[2])) - offset

    @staticmethod
    def from_numbers(f: Any) -> ca.SX:
        return ca.SX(f.offset)

    def moved_by(self, distance: float, normal: Any) -> Expression:
        """The surface `distance` [m] higher along Z."""
        return replace(self, offset=self.offset + distance)

    @property
    def form(self) -> str:
        return f"expression {self._serialized}"


def _unpickled(serialized: str, closed: bool, offset: float = 0.0) -> Expression:
    return Expression(ca.Function.deserialize(serialized), closed, offset)


@dataclass(frozen=True)
class UnknownSurface(Smooth):
    """The place of an `Expression` in the mechanism of a solution that came from a file.

    It says what the surface was called and whether it was `closed`; whatever asks for its equation
    gets an InputError.
    """

    closed: bool = False

    kind: ClassVar[str] = "expression"
    known: ClassVar[bool] = False

    def phi(self, point: Any, constants: Any = None) -> NoReturn:
        raise InputError(
            "this mechanism comes from a solution and had a surface written in Python, of which a "
            "file keeps only a note. To compute with it, build it again in Python, or put the "
            "Expression back with mechanism.replace(contacts=...)"
        )

    def constants(self) -> NoReturn:
        self.phi(None)

    @staticmethod
    def from_numbers(f: Any) -> NoReturn:
        UnknownSurface().phi(None)

    @property
    def form(self) -> NoReturn:
        self.phi(None)

    def at_distance(self, distance: float) -> NoReturn:
        self.phi(None)
