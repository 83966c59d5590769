"""Newton-Euler: free bodies and every joint force.

The platform and each link of each chain are cut free, and the joint forces found link by link
(`free_body`). The force of a chain's last link on the platform at M is

    F = J tau - sum of the forces that its links need,

so the actuator's row J comes from statics here: it is F of massless links under unit effort. No
virtual power, no energy. A rod with two ball joints needs one moment more, about the axis that
its description forbids it to turn about; the base carries it (`rod_guide`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import casadi as ca

from ..kinematics.chain import ChainDynamics, Constants, Family
from ..kinematics.constraints import solve_small
from ..kinematics.moving_base import MovingBase
from ..kinematics.state import PointMotion, State
from .formulation import Formulation, PlatformBody
from .free_body import free_bodies
from .joint_space import JointState, joint_motion


class NewtonEuler(Formulation):
    name: ClassVar[str] = "newton_euler"
    uses_twist: ClassVar[bool] = True

    def platform(self, state: State, body: PlatformBody, g: ca.SX) -> ca.SX:
        """Newton, and Euler about O_M, which the mass centre is S / m away from."""
        omega, omega_rate = state.twist[3:], state.twist_rate[3:]
        inertia = state.R @ body.inertia @ state.R.T
        S = state.R @ body.first_moment
        lift = state.twist_rate[:3] - g
        force = body.mass * lift + ca.cross(omega_rate, S) + ca.cross(omega, ca.cross(omega, S))
        moment = ca.cross(S, lift) + inertia @ omega_rate + ca.cross(omega, inertia @ omega)
        return state.B.T @ ca.vertcat(force, moment)

    def chain(self, family: Family, c: Constants, M: PointMotion, g: ca.SX) -> ChainDynamics:
        if not family.bodies:
            # Nothing to cut free: the actuator's force on M is dual to the joint coordinate.
            return joint_motion(family, c, M).dynamics({})
        s = JointState.symbols()
        bodies = free_bodies(family, c, s, g)
        motion = joint_motion(family, c, M)
        K, R = motion.insert(s, [bodies.K, bodies.R])
        solved = solve_small(K, ca.horzcat(bodies.E, R))[:3, :]
        forces = {name: solved[:, 1 + i] for i, name in enumerate(family.bodies)}
        return replace(motion.dynamics({}), forces=forces, J=solved[:, 0])

    def carried_chain(
        self, family: Family, c: Constants, M: PointMotion, base: MovingBase
    ) -> ca.SX:
        if not family.bodies:
            return ca.SX.zeros(3)
        s = JointState.symbols()
        bodies = free_bodies(family, c, s, ca.SX.zeros(3), base)
        K, R = joint_motion(family, c, M).insert(s, [bodies.K, bodies.R[:, -1]])
        return solve_small(K, R)[:3]
