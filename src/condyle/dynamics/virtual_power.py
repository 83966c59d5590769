"""The operation-minimal formulation: virtual power of each body with closed-form rates.

The platform's balance is written in twist coordinates, the chains by the hand-derived `dynamics` of
their family: no joint space, no arc functions. Same numbers as the paper's models.
"""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from ..kinematics.chain import ChainDynamics, Constants, Family
from ..kinematics.state import PointMotion, State
from .formulation import Formulation, PlatformBody


class VirtualPower(Formulation):
    name: ClassVar[str] = "virtual_power"
    uses_twist: ClassVar[bool] = True
    lumps: ClassVar[bool] = True
    pads: ClassVar[bool] = True

    def platform(self, state: State, body: PlatformBody, g: ca.SX) -> ca.SX:
        """Newton and Euler about O_M, with a first moment S = R s:

        F = m (A - g) + omega' x S + omega x (omega x S),
        M = S x (A - g) + I omega' + omega x I omega.
        """
        omega, omega_rate = state.twist[3:], state.twist_rate[3:]
        lift = state.twist_rate[:3] - g
        S = state.R @ body.first_moment
        # In {M} the inertia is constant: two products with R instead of R I R^T.
        omega_M, omega_rate_M = state.R.T @ omega, state.R.T @ omega_rate
        spin_M = body.inertia @ omega_M
        moment_M = body.inertia @ omega_rate_M + ca.cross(omega_M, spin_M)
        force = body.mass * lift + state.lever_acceleration @ S
        moment = ca.cross(S, lift) + state.R @ moment_M
        return state.B.T @ ca.vertcat(force, moment)

    def chain(self, family: Family, c: Constants, M: PointMotion, g: ca.SX) -> ChainDynamics:
        dynamics = family.dynamics(c, M.position, M.velocity, M.acceleration, g)
        return dynamics.complete(M.acceleration, g)
