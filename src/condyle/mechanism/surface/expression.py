"""A surface written in Python: any CasADi expression of a point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import casadi as ca

from ...errors import InputError
from .parallel import Parallel
from .smooth import Smooth


@dataclass(frozen=True, eq=False)
class Expression(Smooth):
    """phi(p) = 0 for an expression of a point in {S}, taken once, when this is made.

        Expression(lambda p: p[2] - 0.01 * casadi.cos(40 * p[0]))

    phi is in metres, twice differentiable where the contact goes, with a gradient of order 1
    along the normal: upwards, or outwards where the surface is closed. It lives in Python only: a
    mechanism file names kinds and numbers, and nothing in it is evaluated.

    Args:   function: (3,) SX -> scalar SX;  closed: whether the surface has an inside.
    Raises: InputError: if `function` is none, or does not return a scalar expression of the point
            alone.
    """

    function: Callable[[ca.SX], Any]
    closed: bool = False
    _equation: ca.Function = field(init=False, repr=False)

    kind: ClassVar[str] = "expression"

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise InputError(f"a surface needs a function of a point, got {self.function!r}")
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

    def phi(self, point: Any, constants: Any = None) -> Any:
        return self._equation(ca.vertcat(point[0], point[1], point[2]))

    def constants(self) -> tuple[float, ...]:
        return ()

    @property
    def form(self) -> str:
        return f"expression {self._equation.serialize()}"

    def parallel(self, distance: float, point: Any) -> Parallel:
        return Parallel.near(self, distance, point)
