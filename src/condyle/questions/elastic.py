"""Stiffness, inertia and damping of the loaded mechanism, whose drives, rods and legs give.

The equilibrium of the m independent coordinates is f(q) = 0, f = T^T W, with W the wrench of
chains, weights, ligaments and load on the platform and T = d twist / dq. A chain acts on its
platform joint M with a force of its own, so

    K = -df/dq = -(df/dq with these forces held) + sum (dM/dq)^T H (dM/dq),

H = -dF/dM. Both are exact: f is differentiated along the poses that the contacts admit.

Of a chain with stretch e(M, joint) of its rod, tension N of it, weight U(M, joint) and effort tau,

    tau = N e_j + U_j,    F = -(U_M + N e_M),

and its joint follows M where drive, of compliance 1 / k, and rod, of compliance c, balance:

    H = N e_MM + U_MM + [a e_M e_M^T - e_j (e_M g^T + g e_M^T) - c g g^T] / (e_j^2 + c a),
    d joint / dM = -(c g + e_j e_M) / (e_j^2 + c a),

with a = k + N e_jj + U_jj and g = N e_Mj + U_Mj. With c = 0 the joint follows as in the rigid
mechanism; a rigid drive, 1 / k = 0, stands still. Lengths of the file are those at the pose itself:
the load has stretched rods and deflected drives already. Inertia and damping are those of the same
motion of the joint, so freedom of rods is reduced statically.

Contacts that yield add their depths, along unit normals, to q: T has a column more of each. What
balances f along these is their force, whose part of T^T W is itself, and held: what the laws of the
contacts make of a depth is not known here.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ..dynamics.virtual_power import VirtualPower
from ..graph.program import Program
from ..kinematics.chain import FAMILIES
from ..kinematics.chain.family import GivingChain
from ..kinematics.constraints import indices, solve_small
from ..kinematics.state import State, twist_state
from .bound import data_error, off_contacts
from .builder import Builder, Lanes
from .configuration import loops_of
from .curvature import normal_gap
from .equations import Wrench, platform_body
from .linear import add_linear, platform_near
from .numbers import GIVE, single_contacts
from .passive import pulls
from .platform import PlatformState, at_pose, contacts
from .structure import Structure


def elastic(structure: Structure) -> Program:
    """K, M and D (m, m) in q at rest, under efforts and a load, and what they are made of.

    elastic is K without what the load adds, terms what |K| would be if nothing cancelled;
    twist (6, m) moves the load's point; inner is positive where every chain is stable by itself;
    A, a lane, are the rates of joints. Ports: q and a pose of it, efforts and the load.
    """
    b = Builder(structure)
    near, load = platform_near(b, rates=False), Wrench.of(b)
    _add_elastic(b, near, load, b.lane_sample("effort", unit="N m or N"))
    return b.finish()


def elastic_held(structure: Structure) -> Program:
    """The same with the results of `linear`, by which efforts that hold the pose change with it."""
    b = Builder(structure)
    near, load = platform_near(b, rates=True), Wrench.of(b)
    effort = b.lane_sample("effort", unit="N m or N")
    add_linear(b, near, load, effort)
    _add_elastic(b, near, load, effort)
    return b.finish()


def elastic_yielding(structure: Structure) -> Program:
    """As `elastic`, in q and the depths of all contacts, (6, 6), at poses where phi = level.

    Results besides: contact_force (k,) along unit normals, which the efforts leave to the contacts,
    and gap_slope (k, 6), of the gaps along the normals of the levels, see `curvature`.
    """
    b = Builder(structure)
    near, load = platform_near(b, rates=False, yields=True), Wrench.of(b)
    _add_elastic(b, near, load, b.lane_sample("effort", unit="N m or N"), yields=True)
    return b.finish()


def _add_elastic(
    b: Builder, near: PlatformState, load: Wrench, effort: Lanes, yields: bool = False
) -> None:
    X, zero = b.cut(near.pose), ca.SX.zeros(6)
    platform = at_pose(b, X, zero, zero)
    E, V = platform.motion.E, platform.motion.M_J
    if yields:
        V = ca.horzcat(V, _deepened(b, contacts(b, platform).N.T @ E))
    T = E @ V
    state = twist_state(platform.position, platform.R, zero, zero)
    loops = loops_of(b, platform)
    chains = [
        _chain(b, group, state, loop.q_r[0], tau)
        for group, (loop, tau) in enumerate(zip(loops, effort, strict=True))
    ]
    ligaments = pulls(b, state)

    forces = [b.unknown("held", 3, group) for group in range(len(chains))]
    body = platform_body(b, lumped=False)
    W = load.about_centre(platform.R) - VirtualPower().platform(state, body, b.gravity)
    W += sum((ligament.generalized for ligament in ligaments), zero)
    W += b.total([chain.lever @ force for chain, force in zip(chains, forces, strict=True)])
    values = [chain.force for chain in chains]
    if yields:
        pressed = -b.substituted(T[:, b.structure.m :].T @ W, forces, values)
        b.output("contact_force", pressed, "N", pressed.numel())
        b.output("gap_slope", _gap_slopes(b, platform, X) @ V, "", pressed.numel(), 6)
    held = b.substituted(b.jacobian(T.T @ W, X), forces, values) @ V

    def reduced(form: ca.SX) -> ca.SX:
        return T.T @ form @ T

    def of_chains(matrices: list[ca.SX]) -> ca.SX:
        pairs = zip(chains, matrices, strict=True)
        summed = b.total([chain.lever @ matrix @ chain.lever.T for chain, matrix in pairs])
        return ca.reshape(summed, 6, 6)

    def of_ligaments(values: list[ca.SX]) -> ca.SX:
        pairs = zip(ligaments, values, strict=True)
        return sum((x * ligament.row @ ligament.row.T for ligament, x in pairs), ca.SX.zeros(6, 6))

    stretched = of_ligaments([ligament.stiffness for ligament in ligaments])
    unloaded = reduced(of_chains([chain.elastic for chain in chains]) + stretched)
    K = reduced(of_chains([chain.stiffness for chain in chains])) - held
    M = reduced(of_chains([chain.inertia for chain in chains]) + body.of_twist(platform.R))
    slack = of_ligaments([ligament.damping for ligament in ligaments])
    D = reduced(of_chains([chain.damping for chain in chains]) + slack)
    m = T.shape[1]
    for name, value, unit in (("K", K, "N/m"), ("elastic", unloaded, "N/m"), ("M", M, "kg")):
        b.output(name, value, unit, m, m)
    b.output("D", D, "N s/m", m, m)
    b.output("twist", _moved(platform, load.point) @ T, "", 6, m)
    b.output(
        "A",
        [T.T @ (chain.lever @ loop.J) for chain, loop in zip(chains, loops, strict=True)],
        "",
        m,
    )
    b.output("inner", b.least([chain.inner for chain in chains]), "")
    arms = [ca.fabs(chain.lever) for chain in chains]
    pairs = zip(arms, chains, strict=True)
    size = b.total([arm @ ca.fabs(chain.stiffness) @ arm.T for arm, chain in pairs])
    b.output("terms", ca.fabs(T).T @ ca.reshape(size, 6, 6) @ ca.fabs(T), "N/m", m, m)
    off = None if yields else off_contacts(b, platform)
    b.output("data_error", data_error(b, platform, loops, off), "1", 2)


def _deepened(b: Builder, C: ca.SX) -> ca.SX:
    """Rates of the pose, (6, k), by depths of the contacts while q is held.

    Args: C: rates of depths by those of the pose, (k, 6).
    """
    dep = indices(b.structure.dependent)
    rates = ca.SX.zeros(6, len(dep))
    rates[dep, :] = solve_small(C[:, dep], ca.SX.eye(len(dep)))
    return rates


def _gap_slopes(b: Builder, platform: PlatformState, X: ca.SX) -> ca.SX:
    """d gap / d X, (k, 6): one step more of Newton's method from the gap, which changes nothing."""
    slopes = []
    for contact in single_contacts(b.structure, b.parameter):
        at = contact.at(platform.position, platform.R)
        gradient = contact.gradient(at)
        n, gap = gradient / ca.norm_2(gradient), b.unknown("gap", 1)
        foot = at - gap * n
        closer = gap + contact.phi(foot) / ca.dot(contact.gradient(foot), n)
        slopes.append(b.substituted(b.jacobian(closer, X), [gap], [normal_gap(contact, at)]))
    return ca.vertcat(*slopes)


@dataclass(frozen=True)
class _Chain:
    """The chains of one group; matrices, (3, 3), are dual to M'.

    lever: (6, 3), of a force at M its wrench;  force: on the platform, (3,).
    """

    lever: ca.SX
    force: ca.SX
    stiffness: ca.SX
    elastic: ca.SX
    inertia: ca.SX
    damping: ca.SX
    inner: ca.SX


def _chain(b: Builder, group: int, state: State, joint: ca.SX, tau: ca.SX) -> _Chain:
    family, mask = FAMILIES[b.structure.families[group]], b.lane(group, "mask")
    c, point = family.named(b.lane(group, "constants")), state.point(b.lane(group, "joint"))
    rotor, viscous = ca.SX(0), ca.SX(0)
    if b.structure.losses:
        rotor, viscous, *_ = ca.vertsplit(b.lane(group, "actuator"))
    k, yields, short_range, soft, damping = (
        ca.vertsplit(b.lane(group, "give")) if b.structure.gives else _RIGID
    )
    x, v = ca.SX.sym("x", 4), ca.SX.sym("v", 4)  # of M and the joint
    own: GivingChain = family.giving(c, x[:3], x[3], v[:3], v[3])
    weight = -ca.dot(b.gravity, own.height)
    e_xx, e_x = ca.hessian(own.stretch, x)
    U_xx, U_x = ca.hessian(weight, x)
    T_vv, _ = ca.hessian(own.kinetic, v)
    here = ca.vertcat(point.position, joint)
    e_xx, e_x, U_xx, U_x, T_vv = ca.substitute([e_xx, e_x, U_xx, U_x, T_vv], [x], [here])

    e_M, e_j = e_x[:3], e_x[3] + (1 - mask)  # of a lane without a chain anything but 0
    N = (tau - U_x[3]) / e_j
    if family.pulls:
        k = (k + short_range * tau) * (tau > 0)
    L = N * e_xx + U_xx
    a, g = k + yields * L[3, 3], L[:3, 3]
    size = yields * e_j * e_j + soft * a
    mixed = e_M @ g.T
    give = a * e_M @ e_M.T - yields * (e_j * (mixed + mixed.T) + soft * g @ g.T)
    follows = -yields * (soft * g + e_j * e_M) / size
    across = T_vv[:3, 3] @ follows.T
    T_jj = T_vv[3, 3] + rotor
    lever = ca.vertcat(ca.SX.eye(3), ca.skew(point.lever))
    return _Chain(
        lever=lever,
        force=-mask * (U_x[:3] + N * e_M),
        stiffness=mask * (L[:3, :3] + give / size),
        elastic=mask * k * e_M @ e_M.T / (yields * e_j * e_j + soft * k),
        inertia=mask * (T_vv[:3, :3] + across + across.T + T_jj * follows @ follows.T),
        damping=mask * (damping + viscous) * follows @ follows.T,
        inner=size,
    )


_RIGID = tuple(map(ca.SX, (0, 1, 0, 0, 0)))
assert len(_RIGID) == len(GIVE)


def _moved(platform: PlatformState, point: ca.SX) -> ca.SX:
    """(6, 6): the twist about a point of the platform from that about O_M."""
    r = ca.skew(platform.R @ point)
    lower = ca.horzcat(ca.SX.zeros(3, 3), ca.SX.eye(3))
    return ca.vertcat(ca.horzcat(ca.SX.eye(3), -r), lower)
