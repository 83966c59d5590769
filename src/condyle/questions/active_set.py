"""Variables between their ends, some of which are held there: the steps of active-set methods.

As expressions for lanes or for vectors: every step does the same operations, whatever is held.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

FAR = 1e300


@dataclass(frozen=True)
class Active:
    """x between low and high; free: 1, or 0 where it is held at the end at which it is."""

    x: ca.SX
    low: ca.SX
    high: ca.SX
    free: ca.SX

    @staticmethod
    def of(x: ca.SX, low: ca.SX, high: ca.SX) -> Active:
        x = ca.fmin(ca.fmax(x, low), high)
        return Active(x, low, high, (x > low) * (x < high))

    def room(self, target: ca.SX) -> ca.SX:
        """Share of the way to a target that the ends leave."""
        way = target - self.x
        end = ca.if_else(way > 0, self.high, self.low)
        moves = self.free * (way != 0)
        return ca.if_else(moves, (end - self.x) / ca.if_else(moves, way, 1), FAR)

    def moved(self, target: ca.SX, share: ca.SX) -> Active:
        """So far on the way to a target; those that met their ends are held."""
        way = target - self.x
        held = self.free * (self.room(target) <= share) * (share < 1)
        end = ca.if_else(way > 0, self.high, self.low)
        on = ca.if_else(share < 1, self.x + share * way, target)
        x = ca.if_else(self.free, ca.if_else(held, end, on), self.x)
        return Active(x, self.low, self.high, self.free * (1 - held))

    def hindered(self, pull: ca.SX) -> ca.SX:
        """How much those at an end are pulled away from it, 0 where they are pressed on it."""
        inwards = ca.fmax((self.x <= self.low) * pull, -(self.x >= self.high) * pull)
        return ca.fmax((1 - self.free) * (self.low < self.high) * inwards, 0)

    def released(self, these: ca.SX) -> Active:
        return Active(self.x, self.low, self.high, ca.fmax(self.free, these))
