"""A chain cut into free bodies: the force and moment in each of its joints.

The links of a chain stand in a row, from the base to the platform joint M, where the last one
pushes the platform with a force F. Newton and Euler, added up from the platform inwards, give
the force of joint i on link i and its moment about the joint's point P_i,

    W_i = F + sum f_j,
    N_i = (M - P_i) x F + sum [ (E_j - P_i) x f_j + h_j - mu_j w_j ],    j = i, i + 1, ...

with f = m (E'' - g) and h = I omega' + omega x I omega about the mass centre E of a link, and mu
the moment of a guide about w (`rod_guide`). Along its freedoms a joint carries nothing, the
driven one the effort tau. These are as many equations as there are unknowns F and mu, and linear:

    K [F; mu] = E tau - R.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ..kinematics.chain import Constants, Family, Joint
from ..kinematics.moving_base import MovingBase
from .joint_space import JointState


@dataclass(frozen=True)
class Carried:
    """Forces of joints on their links, moments about their points, (3,) each, and guides' moments.

    Expressions in F, mu and the `weight` of each link's inertia, which is 1 in the end; the last
    weight, if the base moves, is that of all that it adds.
    """

    forces: list[ca.SX]
    moments: list[ca.SX]
    guides: list[ca.SX | None]


@dataclass(frozen=True)
class FreeBodies:
    """The balances of one chain, expressions in a joint state.

    end_point: M, (3,).
    K: (3 + guides, 3 + guides)   E: (3 + guides,)   R: (3 + guides, weights), one column a weight.
    """

    joints: list[Joint]
    end_point: ca.SX
    unknown: ca.SX
    weight: ca.SX
    carried: Carried
    K: ca.SX
    E: ca.SX
    R: ca.SX


def free_bodies(
    family: Family, c: Constants, s: JointState, g: ca.SX, base: MovingBase | None = None
) -> FreeBodies:
    """Cut a chain free at the joint state `s`."""
    links, joints = family.links(c, s.q), family.joints(c, s.q)
    M = family.end_point(c, s.q)
    count = sum(joint.guide is not None for joint in joints)
    unknown, weight = (
        ca.SX.sym("unknown", 3 + count),
        ca.SX.sym("weight", len(links) + (base is not None)),
    )
    F = unknown[:3]

    # From the platform inwards: force, and moment about the origin of {S}.
    force, moment = F, ca.cross(M, F)
    carried = Carried([], [], [])
    free: list[ca.SX] = []
    effort: list[float] = []
    for i in reversed(range(len(links))):
        link, joint = links[i], joints[i]
        velocity = ca.jtimes(link.centre, s.q, s.rate)
        omega = link.spin @ s.rate
        f = weight[i] * link.mass * (s.time_derivative(velocity) - g)
        h = weight[i] * (
            link.inertia @ s.time_derivative(omega) + ca.cross(omega, link.inertia @ omega)
        )
        if base is not None:
            f += weight[-1] * link.mass * base.acceleration(link.centre, velocity)
            h += weight[-1] * base.moment(link.inertia, omega)
        force = force + f
        moment = moment + ca.cross(link.centre, f) + h
        guide = None
        if joint.guide is not None:
            guide = unknown[2 + count] * joint.guide
            moment, count = moment - guide, count - 1
        about_joint = moment - ca.cross(joint.point, force)
        for axes, value in ((joint.slides, force), (joint.turns, about_joint)):
            free.append(axes.T @ value)
            effort += [float(joint.driven)] * axes.shape[1]
        carried.forces.insert(0, force)
        carried.moments.insert(0, about_joint)
        carried.guides.insert(0, guide)
    balance = ca.vertcat(*free)
    return FreeBodies(
        joints,
        M,
        unknown,
        weight,
        carried,
        K=ca.jacobian(balance, unknown),
        E=ca.SX(ca.DM(effort)),
        R=ca.jacobian(balance, weight),
    )
