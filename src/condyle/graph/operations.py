"""The operations of a graph, one row each: their CasADi code, C, numpy and derivatives.

    f(a, b)' = (df/da) a' + (df/db) b'

A new way to run graphs reads this table; a new operation is a row of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca
import numpy as np

Value = int  # a node's number


class Algebra(Protocol):
    """A graph, as derivatives see it."""

    def apply(self, op: str, *args: Value) -> Value: ...

    def const(self, value: float) -> Value: ...


@dataclass(frozen=True)
class Operand:
    """A value of a graph with operators, to write derivatives with."""

    graph: Algebra
    value: Value

    def of(self, op: str, *others: Any) -> Operand:
        """An operation on this value and others, terms or numbers."""
        return Operand(self.graph, self.graph.apply(op, *(self._read(x) for x in (self, *others))))

    def _read(self, x: Any) -> Value:
        return x.value if isinstance(x, Operand) else self.graph.const(x)

    def __add__(self, x: Any) -> Operand:
        return self.of("add", x)

    def __sub__(self, x: Any) -> Operand:
        return self.of("sub", x)

    def __mul__(self, x: Any) -> Operand:
        return self.of("mul", x)

    def __neg__(self) -> Operand:
        return self.of("neg")

    def __radd__(self, x: float) -> Operand:
        return Operand(self.graph, self.graph.const(x)).of("add", self)

    def __rsub__(self, x: float) -> Operand:
        return Operand(self.graph, self.graph.const(x)).of("sub", self)

    def __rmul__(self, x: float) -> Operand:
        return Operand(self.graph, self.graph.const(x)).of("mul", self)

    def inverse(self) -> Operand:
        """1 / x."""
        return Operand(self.graph, self.graph.const(1.0)).of("div", self)

    def __getattr__(self, op: str) -> Callable[[], Operand]:
        if op not in OPERATIONS:
            raise AttributeError(op)
        return lambda: self.of(op)


@dataclass(frozen=True)
class Operation:
    """One operation.

    casadi:  its number there, None if only `fuse` makes it.
    numpy:   the same on arrays.
    slopes:  (value, *arguments) -> the derivative in each argument, None where it vanishes but at
             jumps; None: in all.
    infix:   C's sign for it; without one it is a function of its name.
    latency: cycles from arguments to value.
    """

    name: str
    casadi: int | None
    numpy: Callable[..., Any]
    slopes: Callable[..., tuple[Any, ...]] | None = None
    infix: str | None = None
    latency: int = 4

    @property
    def into(self) -> Callable[..., Any]:
        """The same as `numpy`, into the array `out`."""
        if isinstance(self.numpy, np.ufunc):
            return self.numpy
        function = self.numpy
        return lambda *args, out: np.copyto(out, function(*args))

    def partials(self, g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
        """The derivative of value v in each of its arguments x."""
        if self.slopes is None:
            return [None] * len(x)
        value = Operand(g, v)
        found = self.slopes(value, *(Operand(g, a) for a in x))
        return [None if f is None else value._read(f) for f in found]


def _quotient(v: Operand, a: Operand, b: Operand) -> tuple[Operand, Operand]:
    inverse = b.inverse()
    return inverse, -(v * inverse)


def _angle(v: Operand, a: Operand, b: Operand) -> tuple[Operand, Operand]:
    inverse = (a * a + b * b).inverse()
    return b * inverse, -(a * inverse)


def _chosen(first: Callable[[Operand, Operand], Operand]) -> Callable[..., tuple[Operand, Operand]]:
    """The slopes of a minimum or maximum: 1 for the argument that is taken, else 0."""

    def slopes(v: Operand, a: Operand, b: Operand) -> tuple[Operand, Operand]:
        taken = first(a, b)
        return taken, 1.0 - taken

    return slopes


def _hypotenuse(v: Operand, a: Operand, b: Operand) -> tuple[Operand, Operand]:
    inverse = v.inverse()
    return a * inverse, b * inverse


def _remainder(v: Operand, a: Operand, b: Operand) -> tuple[float, Operand]:
    """a - k b with an integer k = (a - v) / b."""
    return 1.0, -(a - v).of("div", b)


def _copied_sign(v: Operand, a: Operand, b: Operand) -> tuple[Operand, None]:
    return a.sign() * Operand(a.graph, a.graph.const(1.0)).of("copysign", b), None


def _truth(compare: Callable[..., Any]) -> Callable[..., Any]:
    return lambda a, b: compare(a, b).astype(float)


def _erf_of(a: Any) -> Any:
    from scipy.special import erf

    return erf(a)


_ROWS = (
    Operation("add", ca.OP_ADD, np.add, lambda v, a, b: (1.0, 1.0), "+"),
    Operation("sub", ca.OP_SUB, np.subtract, lambda v, a, b: (1.0, -1.0), "-"),
    Operation("mul", ca.OP_MUL, np.multiply, lambda v, a, b: (b, a), "*"),
    Operation("div", ca.OP_DIV, np.divide, _quotient, "/", latency=14),
    Operation("neg", ca.OP_NEG, np.negative, lambda v, a: (-1.0,)),
    # A product in a sum, c + a b and c - a b: made by `fuse`.
    Operation("fma", None, lambda a, b, c: c + a * b, lambda v, a, b, c: (b, a, 1.0)),
    Operation("fnma", None, lambda a, b, c: c - a * b, lambda v, a, b, c: (-b, -a, 1.0)),
    Operation("sqrt", ca.OP_SQRT, np.sqrt, lambda v, a: (0.5 * v.inverse(),), latency=18),
    Operation("sin", ca.OP_SIN, np.sin, lambda v, a: (a.cos(),), latency=40),
    Operation("cos", ca.OP_COS, np.cos, lambda v, a: (-a.sin(),), latency=40),
    Operation("atan2", ca.OP_ATAN2, np.arctan2, _angle, latency=80),
    Operation("fabs", ca.OP_FABS, np.abs, lambda v, a: (a.sign(),)),
    # As in C: the second argument where either is NaN.
    Operation(
        "fmin", ca.OP_FMIN, lambda a, b: np.where(a < b, a, b), _chosen(lambda a, b: a.of("le", b))
    ),
    Operation(
        "fmax", ca.OP_FMAX, lambda a, b: np.where(a > b, a, b), _chosen(lambda a, b: b.of("le", a))
    ),
    Operation("le", ca.OP_LE, _truth(np.less_equal)),
    Operation("lt", ca.OP_LT, _truth(np.less)),
    Operation("eq", ca.OP_EQ, _truth(np.equal)),
    Operation("ne", ca.OP_NE, _truth(np.not_equal)),
    Operation("and", ca.OP_AND, _truth(np.logical_and)),
    Operation("or", ca.OP_OR, _truth(np.logical_or)),
    Operation("not", ca.OP_NOT, lambda a: np.logical_not(a).astype(float)),
    Operation(
        "where",
        ca.OP_IF_ELSE_ZERO,
        lambda a, b: np.where(a != 0, b, 0.0),
        lambda v, a, b: (None, a.of("where", 1.0)),
    ),
    Operation("sign", ca.OP_SIGN, np.sign),
    Operation("floor", ca.OP_FLOOR, np.floor),
    Operation("ceil", ca.OP_CEIL, np.ceil),
    Operation("fmod", ca.OP_FMOD, np.fmod, _remainder),
    Operation("remainder", ca.OP_REMAINDER, lambda a, b: a - b * np.rint(a / b), _remainder),
    Operation("copysign", ca.OP_COPYSIGN, np.copysign, _copied_sign),
    Operation("hypot", ca.OP_HYPOT, np.hypot, _hypotenuse),
    Operation("pow", ca.OP_POW, np.power, lambda v, a, b: (b * a.of("pow", b - 1.0), v * a.log())),
    Operation("exp", ca.OP_EXP, np.exp, lambda v, a: (v,)),
    Operation("expm1", ca.OP_EXPM1, np.expm1, lambda v, a: (a.exp(),)),
    Operation("log", ca.OP_LOG, np.log, lambda v, a: (a.inverse(),)),
    Operation("log1p", ca.OP_LOG1P, np.log1p, lambda v, a: ((1.0 + a).inverse(),)),
    Operation("tan", ca.OP_TAN, np.tan, lambda v, a: (1.0 + v * v,)),
    Operation("asin", ca.OP_ASIN, np.arcsin, lambda v, a: ((1.0 - a * a).sqrt().inverse(),)),
    Operation("acos", ca.OP_ACOS, np.arccos, lambda v, a: (-(1.0 - a * a).sqrt().inverse(),)),
    Operation("atan", ca.OP_ATAN, np.arctan, lambda v, a: ((1.0 + a * a).inverse(),)),
    Operation("sinh", ca.OP_SINH, np.sinh, lambda v, a: (a.cosh(),)),
    Operation("cosh", ca.OP_COSH, np.cosh, lambda v, a: (a.sinh(),)),
    Operation("tanh", ca.OP_TANH, np.tanh, lambda v, a: (1.0 - v * v,)),
    Operation("asinh", ca.OP_ASINH, np.arcsinh, lambda v, a: ((1.0 + a * a).sqrt().inverse(),)),
    Operation("acosh", ca.OP_ACOSH, np.arccosh, lambda v, a: ((a * a - 1.0).sqrt().inverse(),)),
    Operation("atanh", ca.OP_ATANH, np.arctanh, lambda v, a: ((1.0 - a * a).inverse(),)),
    Operation("erf", ca.OP_ERF, _erf_of, lambda v, a: (2 / math.sqrt(math.pi) * (-(a * a)).exp(),)),
)
OPERATIONS = {row.name: row for row in _ROWS}
BY_CASADI: dict[int, str] = {r.casadi: r.name for r in _ROWS if r.casadi is not None}
BY_CASADI[ca.OP_CONSTPOW] = "pow"
REDUCTIONS = ("sum", "least")
REDUCTION_LATENCY = 22


def latency(op: str) -> int:
    """Cycles from an operation's arguments to its value."""
    return REDUCTION_LATENCY if op in REDUCTIONS else OPERATIONS[op].latency
