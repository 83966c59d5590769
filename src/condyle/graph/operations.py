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
    """What derivatives are written with: a graph."""

    def apply(self, op: str, *args: Value) -> Value: ...

    def const(self, value: float) -> Value: ...


Partials = Callable[[Algebra, Value, Sequence[Value]], Sequence[Value | None]]


@dataclass(frozen=True)
class Operation:
    """One operation.

    casadi:   its number there, None for what is made of others on the way.
    numpy:    the same on arrays.
    partials: (graph, value, arguments) -> the derivative in each argument; None where it is zero
              but at jumps.
    infix:    C's sign for it; without one it is a function of its name.
    latency:  cycles from arguments to value.
    """

    name: str
    casadi: int | None
    numpy: Callable[..., Any]
    partials: Partials
    infix: str | None = None
    latency: int = 4

    @property
    def into(self) -> Callable[..., Any]:
        """The same as `numpy`, into the array `out`."""
        if isinstance(self.numpy, np.ufunc):
            return self.numpy
        function = self.numpy
        return lambda *args, out: np.copyto(out, function(*args))


def _flat(count: int) -> Partials:
    return lambda g, v, x: [None] * count


def _square_below(g: Algebra, a: Value, sign: str) -> Value:
    """1 - a^2 or 1 + a^2."""
    return g.apply(sign, g.const(1.0), g.apply("mul", a, a))


def _inverse(g: Algebra, a: Value) -> Value:
    return g.apply("div", g.const(1.0), a)


def _scaled(g: Algebra, a: Value, factor: float) -> Value:
    return g.apply("mul", g.const(factor), a)


def _product(*names: str) -> Partials:
    """Derivative of a function of one argument, as a product of functions of that argument."""

    def partials(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
        total = g.const(1.0)
        for name in names:
            total = g.apply("mul", total, g.apply(name, x[0]))
        return [total]

    return partials


def _root(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    return [_scaled(g, _inverse(g, v), 0.5)]


def _arc(sign: str, negative: bool = False) -> Partials:
    """+-1 / sqrt(1 -+ a^2)."""

    def partials(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
        slope = _inverse(g, g.apply("sqrt", _square_below(g, x[0], sign)))
        return [g.apply("neg", slope) if negative else slope]

    return partials


def _acosh(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    below = g.apply("sub", g.apply("mul", x[0], x[0]), g.const(1.0))
    return [_inverse(g, g.apply("sqrt", below))]


def _rational(sign: str) -> Partials:
    return lambda g, v, x: [_inverse(g, _square_below(g, x[0], sign))]


def _erf(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    bell = g.apply("exp", g.apply("neg", g.apply("mul", x[0], x[0])))
    return [_scaled(g, bell, 2 / math.sqrt(math.pi))]


def _power(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    a, b = x
    lower = g.apply("pow", a, g.apply("sub", b, g.const(1.0)))
    return [g.apply("mul", b, lower), g.apply("mul", v, g.apply("log", a))]


def _quotient(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    inverse = _inverse(g, x[1])
    return [inverse, g.apply("neg", g.apply("mul", v, inverse))]


def _angle(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    square = g.apply("add", g.apply("mul", x[0], x[0]), g.apply("mul", x[1], x[1]))
    inverse = _inverse(g, square)
    return [g.apply("mul", x[1], inverse), g.apply("neg", g.apply("mul", x[0], inverse))]


def _either(first: str) -> Partials:
    """Of a minimum or maximum: one where the argument is taken, else nothing."""

    def partials(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
        taken = g.apply("le", *(x if first == "a" else x[::-1]))
        return [taken, g.apply("sub", g.const(1.0), taken)]

    return partials


def _size(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    return [g.apply("sign", x[0])]


def _hypotenuse(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    inverse = _inverse(g, v)
    return [g.apply("mul", a, inverse) for a in x]


def _copied_sign(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    same = g.apply("mul", g.apply("sign", x[0]), g.apply("copysign", g.const(1.0), x[1]))
    return [same, None]


def _remaining(name: str) -> Partials:
    """a - k b with a whole k: (a - value) / b."""

    def partials(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
        k = g.apply("div", g.apply("sub", x[0], v), x[1])
        return [g.const(1.0), g.apply("neg", k)]

    return partials


def _where(g: Algebra, v: Value, x: Sequence[Value]) -> list[Value | None]:
    return [None, g.apply("where", x[0], g.const(1.0))]


def _fused(sign: float) -> Partials:
    return lambda g, v, x: [
        x[1] if sign > 0 else g.apply("neg", x[1]),
        x[0] if sign > 0 else g.apply("neg", x[0]),
        g.const(1.0),
    ]


def _truth(compare: Callable[..., Any]) -> Callable[..., Any]:
    return lambda a, b: compare(a, b).astype(float)


def _erf_of(a: Any) -> Any:
    from scipy.special import erf

    return erf(a)


_ROWS = (
    Operation("add", ca.OP_ADD, np.add, lambda g, v, x: [g.const(1.0), g.const(1.0)], "+"),
    Operation("sub", ca.OP_SUB, np.subtract, lambda g, v, x: [g.const(1.0), g.const(-1.0)], "-"),
    Operation("mul", ca.OP_MUL, np.multiply, lambda g, v, x: [x[1], x[0]], "*"),
    Operation("div", ca.OP_DIV, np.divide, _quotient, "/", latency=14),
    Operation("neg", ca.OP_NEG, np.negative, lambda g, v, x: [g.const(-1.0)]),
    # A product in a sum, c + a b and c - a b: made by `fuse`.
    Operation("fma", None, lambda a, b, c: c + a * b, _fused(1.0)),
    Operation("fnma", None, lambda a, b, c: c - a * b, _fused(-1.0)),
    Operation("sqrt", ca.OP_SQRT, np.sqrt, _root, latency=18),
    Operation("sin", ca.OP_SIN, np.sin, _product("cos"), latency=40),
    Operation(
        "cos",
        ca.OP_COS,
        np.cos,
        lambda g, v, x: [g.apply("neg", g.apply("sin", x[0]))],
        latency=40,
    ),
    Operation("atan2", ca.OP_ATAN2, np.arctan2, _angle, latency=80),
    Operation("fabs", ca.OP_FABS, np.abs, _size),
    # As C's comparison has it: the second argument where either is no number.
    Operation("fmin", ca.OP_FMIN, lambda a, b: np.where(a < b, a, b), _either("a")),
    Operation("fmax", ca.OP_FMAX, lambda a, b: np.where(a > b, a, b), _either("b")),
    Operation("le", ca.OP_LE, _truth(np.less_equal), _flat(2)),
    Operation("lt", ca.OP_LT, _truth(np.less), _flat(2)),
    Operation("eq", ca.OP_EQ, _truth(np.equal), _flat(2)),
    Operation("ne", ca.OP_NE, _truth(np.not_equal), _flat(2)),
    Operation("and", ca.OP_AND, _truth(np.logical_and), _flat(2)),
    Operation("or", ca.OP_OR, _truth(np.logical_or), _flat(2)),
    Operation("not", ca.OP_NOT, lambda a: np.logical_not(a).astype(float), _flat(1)),
    Operation("where", ca.OP_IF_ELSE_ZERO, lambda a, b: np.where(a != 0, b, 0.0), _where),
    Operation("sign", ca.OP_SIGN, np.sign, _flat(1)),
    Operation("floor", ca.OP_FLOOR, np.floor, _flat(1)),
    Operation("ceil", ca.OP_CEIL, np.ceil, _flat(1)),
    Operation("fmod", ca.OP_FMOD, np.fmod, _remaining("fmod")),
    Operation(
        "remainder",
        ca.OP_REMAINDER,
        lambda a, b: a - b * np.rint(a / b),
        _remaining("remainder"),
    ),
    Operation("copysign", ca.OP_COPYSIGN, np.copysign, _copied_sign),
    Operation("hypot", ca.OP_HYPOT, np.hypot, _hypotenuse),
    Operation("pow", ca.OP_POW, np.power, _power),
    Operation("exp", ca.OP_EXP, np.exp, lambda g, v, x: [v]),
    Operation("expm1", ca.OP_EXPM1, np.expm1, _product("exp")),
    Operation("log", ca.OP_LOG, np.log, lambda g, v, x: [_inverse(g, x[0])]),
    Operation(
        "log1p",
        ca.OP_LOG1P,
        np.log1p,
        lambda g, v, x: [_inverse(g, g.apply("add", g.const(1.0), x[0]))],
    ),
    Operation("tan", ca.OP_TAN, np.tan, lambda g, v, x: [_square_below(g, v, "add")]),
    Operation("asin", ca.OP_ASIN, np.arcsin, _arc("sub")),
    Operation("acos", ca.OP_ACOS, np.arccos, _arc("sub", negative=True)),
    Operation("atan", ca.OP_ATAN, np.arctan, _rational("add")),
    Operation("sinh", ca.OP_SINH, np.sinh, _product("cosh")),
    Operation("cosh", ca.OP_COSH, np.cosh, _product("sinh")),
    Operation("tanh", ca.OP_TANH, np.tanh, lambda g, v, x: [_square_below(g, v, "sub")]),
    Operation("asinh", ca.OP_ASINH, np.arcsinh, _arc("add")),
    Operation("acosh", ca.OP_ACOSH, np.arccosh, _acosh),
    Operation("atanh", ca.OP_ATANH, np.arctanh, _rational("sub")),
    Operation("erf", ca.OP_ERF, _erf_of, _erf),
)
OPERATIONS = {row.name: row for row in _ROWS}
BY_CASADI: dict[int, str] = {r.casadi: r.name for r in _ROWS if r.casadi is not None}
BY_CASADI[ca.OP_CONSTPOW] = "pow"
REDUCTIONS = ("sum", "least")
REDUCTION_LATENCY = 22


def latency(op: str) -> int:
    """Cycles from an operation's arguments to its value."""
    return REDUCTION_LATENCY if op in REDUCTIONS else OPERATIONS[op].latency
