"""The inertia that a moving base adds: forces and moments of bodies that the base carries along.

Coordinates and their rates are relative to {S}, which is fixed to the base. With the acceleration a
of the origin of {S}, its angular velocity w and acceleration w', in {S}, a point at r that moves
with v, and a body that turns with omega, need besides m v' and I omega' + omega x I omega

    force:   m [a + w' x r + w x (w x r) + 2 w x v],
    moment:  I (w' + w x omega) + w x I omega + omega x I w + w x I w.

None of it depends on accelerations relative to the base.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class MovingBase:
    """The base's motion in {S}: acceleration a, angular velocity w and acceleration w', (3,)."""

    a: ca.SX
    w: ca.SX
    w_rate: ca.SX

    def acceleration(self, position: ca.SX, velocity: ca.SX) -> ca.SX:
        """The acceleration of a point, (3,), besides that relative to {S}."""
        return self.a + self.turning(position, velocity)

    def turning(self, lever: ca.SX, velocity: ca.SX) -> ca.SX:
        """The same less a: linear in lever and velocity."""
        return ca.cross(self.w_rate, lever) + ca.cross(
            self.w, ca.cross(self.w, lever) + 2 * velocity
        )

    def moment(self, inertia: ca.SX, omega: ca.SX) -> ca.SX:
        """Rate of the angular momentum, (3,), besides that relative to {S}.

        Args: inertia: in {S}, (3, 3), about the mass centre or another point of the body;
              omega: relative to {S}.
        """
        w, spin = self.w, inertia @ self.w
        turned = inertia @ (self.w_rate + ca.cross(w, omega)) + ca.cross(omega, spin)
        return turned + ca.cross(w, inertia @ omega + spin)
