"""Second-order jets: numbers and vectors that carry their first two time derivatives.

With them positions alone give exact velocities and accelerations: nothing is differentiated by
hand, and nothing of condyle is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Jet:
    """x, x', x'' of a scalar or an array."""

    x: Array
    v: Array
    a: Array

    def __add__(self, other: Jet | Array | float) -> Jet:
        o = jet(other)
        return Jet(self.x + o.x, self.v + o.v, self.a + o.a)

    def __neg__(self) -> Jet:
        return Jet(-self.x, -self.v, -self.a)

    def __sub__(self, other: Jet | Array | float) -> Jet:
        return self + (-jet(other))

    def __mul__(self, other: Jet | Array | float) -> Jet:
        o = jet(other)
        v = self.v * o.x + self.x * o.v
        return Jet(self.x * o.x, v, self.a * o.x + 2 * self.v * o.v + self.x * o.a)

    __rmul__ = __mul__
    __radd__ = __add__

    def __matmul__(self, other: Jet | Array) -> Jet:
        o = jet(other)
        v = self.v @ o.x + self.x @ o.v
        return Jet(self.x @ o.x, v, self.a @ o.x + 2 * self.v @ o.v + self.x @ o.a)

    def __getitem__(self, index: int) -> Jet:
        return Jet(self.x[index], self.v[index], self.a[index])

    @property
    def T(self) -> Jet:
        return Jet(self.x.T, self.v.T, self.a.T)

    def map(self, f: float, first: float, second: float) -> Jet:
        """A function of a scalar jet, from its value and derivatives there."""
        return Jet(f, first * self.v, second * self.v**2 + first * self.a)


def jet(value: Jet | Array | float) -> Jet:
    if isinstance(value, Jet):
        return value
    x = np.asarray(value, float)
    return Jet(x, 0 * x, 0 * x)


def sin(x: Jet) -> Jet:
    return x.map(np.sin(x.x), np.cos(x.x), -np.sin(x.x))


def cos(x: Jet) -> Jet:
    return x.map(np.cos(x.x), -np.sin(x.x), -np.cos(x.x))


def power(x: Jet, exponent: float) -> Jet:
    p = exponent
    return x.map(x.x**p, p * x.x ** (p - 1), p * (p - 1) * x.x ** (p - 2))


def length(vector: Jet) -> Jet:
    return power(vector @ vector, 0.5)


def matrix(rows: list[list[Jet | float]]) -> Jet:
    parts = [[jet(entry) for entry in row] for row in rows]
    return Jet(*(np.array([[getattr(e, k) for e in row] for row in parts]) for k in "xva"))


def rotation_x(c: Jet | float, s: Jet) -> Jet:
    return matrix([[1, 0, 0], [0, c, -s], [0, s, c]])


def rotation_y(c: Jet, s: Jet) -> Jet:
    return matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rotation_z(c: Jet, s: Jet) -> Jet:
    return matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def spin(R: Jet) -> tuple[Array, Array]:
    """omega and its rate, from a rotation matrix: [omega] = R' R^T."""
    W, W_rate = R.v @ R.x.T, R.a @ R.x.T + R.v @ R.v.T

    def vector(S: Array) -> Array:
        return np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]]) / 2

    return vector(W), vector(W_rate)
