"""Pose, joints and rates at an instant, and the energy of a state."""

from __future__ import annotations

import casadi as ca

from ..dynamics.joint_space import chain_jacobians
from ..graph.program import Program
from ..kinematics.chain import FAMILIES
from ..kinematics.state import twist_state
from ..status import Status
from .builder import Builder
from .configuration import loops_of, on_rates
from .equations import Wrench, platform_body
from .inertia import Affine, affine
from .passive import pulls
from .platform import ANGLE_UNITS, PlatformState, check_contacts, closed
from .structure import Structure


def instant(structure: Structure) -> Program:
    """Pose and joints from the independent coordinates and rates.

    Results: pose, pose_rate (6,); R (3, 3); joint, joint_rate, and A (m,) a lane: theta' = A q'.
    """
    b = Builder(structure)
    platform = closed(b, rates=1)
    b.output("pose", platform.pose, ANGLE_UNITS)
    b.output("pose_rate", platform.motion.rate, "per s")
    b.output("R", platform.R, "1", 3, 3)
    loops = loops_of(b, platform)
    rows = on_rates(b, platform, [loop.J for loop in loops])
    b.output("joint", [loop.q_r[0] for loop in loops], "rad or m")
    b.output("joint_rate", [ca.dot(row, platform.q1) for row in rows], "rad/s or m/s")
    b.output("A", rows, "", structure.m)
    check_contacts(b, platform.placement)
    b.check(b.least([loop.discriminant for loop in loops]), 0.0, Status.unreachable)
    return b.finish()


def energy(structure: Structure) -> Program:
    """Kinetic and potential energy [J], from q and q'; the potential, gravity's and of
    ligaments, is 0 at the origin of {S} where they are slack.
    """
    b = Builder(structure)
    platform = closed(b, rates=1)
    motion, g = platform.motion, b.gravity
    body = platform_body(b, lumped=False)
    V, omega = motion.twist[:3], motion.twist[3:]
    kinetic = body.kinetic(platform.R, V, omega)
    potential = -ca.dot(g, body.height(platform.placement.position, platform.R))
    state = twist_state(platform.position, motion.R, motion.twist, motion.twist_rate)
    potential += sum((one.stored for one in pulls(b, state)), ca.SX(0))
    moving, held = [], []
    for group, loop in enumerate(loops_of(b, platform)):
        family = FAMILIES[structure.families[group]]
        c = family.named(b.lane(group, "constants"))
        r = platform.R @ b.lane(group, "joint")
        _, inverse = chain_jacobians(family, c, loop.q_r)
        rate = inverse @ (V + ca.cross(omega, r))
        own, high = ca.SX(0), ca.SX(0)
        q = ca.SX.sym("q_r", 3)
        for link in family.links(c, q):
            speed = ca.jacobian(link.centre, q) @ rate
            turn = link.spin @ rate
            own += link.mass * ca.dot(speed, speed) / 2 + ca.dot(turn, link.inertia @ turn) / 2
            high -= link.mass * ca.dot(g, link.centre)
        own, high = ca.substitute([own, high], [q], [loop.q_r])
        if structure.losses:
            own += b.lane(group, "actuator")[0] * rate[0] ** 2 / 2
        mask = b.lane(group, "mask")
        moving.append(mask * own)
        held.append(mask * high)
    b.output("kinetic", kinetic + b.total(moving), "J")
    b.output("potential", potential + b.total(held), "J")
    return b.finish()


def losses(b: Builder, group: int, rate: ca.SX) -> ca.SX:
    """Power dissipated by an actuator's viscous and Coulomb friction [W]."""
    if not b.structure.losses:
        return 0 * rate
    _, viscous, coulomb, square = ca.vertsplit(b.lane(group, "actuator"))
    return (viscous + coulomb / ca.sqrt(rate * rate + square)) * rate * rate


def inertia_matrix(b: Builder, platform: PlatformState) -> ca.SX:
    """M_r of `matrices`, (m, m), at any rates of the platform."""
    eq = _unloaded(b, platform)
    pulled = eq.basis.generalized_force(_symmetric(eq.H))  # Pi^T H
    return eq.S.T @ eq.basis.generalized_force(pulled.T) @ eq.S


def inertia_matrix_X(b: Builder, platform: PlatformState) -> ca.SX:
    """The same dual to X_EE, (6, 6), in twists."""
    E = platform.motion.E
    return E.T @ _symmetric(_unloaded(b, platform).H) @ E


def _unloaded(b: Builder, platform: PlatformState) -> Affine:
    zero = ca.SX.zeros(3)
    no_effort = [ca.SX(0) for _ in b.structure.families]
    return affine(b, platform, Wrench(zero, zero, zero), no_effort)


def _symmetric(H: ca.SX) -> ca.SX:
    return ca.triu(H) + ca.triu(H, False).T
