"""Second-order jets: arrays that carry their first two time derivatives.

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

    def map(self, f: float, first: float, second: float) -> Jet:
        """A function of a scalar jet, from its value and derivatives there."""
        return Jet(f, first * self.v, second * self.v**2 + first * self.a)


def jet(value: Jet | Array | float) -> Jet:
    if isinstance(value, Jet):
        return value
    x = np.asarray(value, float)
    return Jet(x, 0 * x, 0 * x)


def spin(R: Jet) -> tuple[Array, Array]:
    """omega and its rate, from a rotation matrix: [omega] = R' R^T."""
    W, W_rate = R.v @ R.x.T, R.a @ R.x.T + R.v @ R.v.T

    def vector(S: Array) -> Array:
        return np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]]) / 2

    return vector(W), vector(W_rate)
