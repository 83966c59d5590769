"""Exact derivatives of a surface's equation, by CasADi."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import casadi as ca


class Smooth(ABC):
    """What has an equation phi(point, constants), twice differentiable.

    known: whether that equation is at hand.
    """

    known: ClassVar[bool] = True

    @abstractmethod
    def phi(self, point: Any, constants: Any = None) -> Any:
        """How far a point, (3,), is off the surface [m], positive along the normal."""

    def gradient(self, point: ca.SX, constants: Any = None) -> ca.SX:
        """d phi / d point, (3,): along the unit normal."""
        p = ca.SX.sym("p", 3)
        return ca.substitute(ca.gradient(self.phi(p, constants), p), p, point)

    def bending(self, point: ca.SX, velocity: ca.SX, constants: Any = None) -> ca.SX:
        """v^T (d2 phi / d point2) v: what phi'' owes to a velocity, (3,), alone."""
        p = ca.SX.sym("p", 3)
        change = ca.jtimes(ca.gradient(self.phi(p, constants), p), p, velocity)
        return ca.dot(ca.substitute(change, p, point), velocity)

    def started_at(self, point: ca.SX, constants: Any = None) -> Smooth:
        """The surface for points near `point`, which need not search as far as any point would.

        It is the less exact the farther they are; it may be this surface itself.
        """
        return self
