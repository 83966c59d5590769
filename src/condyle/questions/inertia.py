"""The equations of motion, affine in the accelerations:

    Q - J^T tau = H c'' + F,

where c' are the rates of their state, (s,). A chain meets the platform at one point M, so it adds a
symmetric 3 x 3 matrix to H, its effective mass at M:

    d F_M / d M'' = A_M,        H = H_platform + sum [E; [r]] A_M [E, [r]^T],

with r the lever of M and [r] f = r x f. A_M comes from the chain's own dynamics, by exact
derivatives within the lane. Formulations other than `virtual_power` give H by derivatives of the
whole sum instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca

from ..dynamics import FORMULATIONS
from ..dynamics.virtual_power import VirtualPower
from ..kinematics.chain import FAMILIES, ChainDynamics
from ..kinematics.state import State, twist_state
from .builder import Builder, Lanes
from .equations import Wrench, carried, equations, loss, platform_body, symmetric, total
from .passive import bearing
from .platform import Basis, PlatformState, twist_basis

UPPER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # as `symmetric` takes them


@dataclass(frozen=True)
class Affine:
    """The equations of one sample: Q - J^T tau = H c'' + F, and c'' = start + Pi w.

    H: (s, s), symmetric; its upper triangle counts.   F: (s,), the sum of parts.   start: (s,).
    basis: Pi.   S: (m, m), w = S q''.
    B: (6, s), [V; omega] = B c'.   G: (s, k), along which the contacts act.
    rows: of J, dual to c', one a group.   rates: of the joints.
    biases: accelerations of the joints where c'' = 0.   chains: their motion.
    """

    H: ca.SX
    F: ca.SX
    start: ca.SX
    basis: Basis
    S: ca.SX
    B: ca.SX
    G: ca.SX
    rows: Lanes
    rates: Lanes
    biases: Lanes
    chains: list[ChainDynamics]
    parts: list[ca.SX]

    @property
    def discriminants(self) -> Lanes:
        return [chain.discriminant for chain in self.chains]


def affine(b: Builder, platform: PlatformState, load: Wrench, effort: Lanes) -> Affine:
    """The equations of a platform whose accelerations are those of q'' = 0."""
    if b.structure.formulation == VirtualPower.name:
        return _by_chains(b, platform, load, effort)
    return _by_derivatives(b, platform, load, effort)


def _by_chains(b: Builder, platform: PlatformState, load: Wrench, effort: Lanes) -> Affine:
    """The equations in twists, from every chain's effective mass at its platform joint."""
    s, motion = b.structure, platform.motion
    method, body, g = VirtualPower(), platform_body(b, lumped=True), b.gravity
    # Forces due to the rates alone: accelerations add H times them.
    state = twist_state(platform.placement.position, motion.R, motion.twist, ca.SX.zeros(6))
    chains = [_chain(b, group, state, g, effort[group]) for group in range(len(s.chains))]
    sums = b.total([c.terms for c in chains])
    coupled = ca.reshape(sums[12:21], 3, 3)
    mass, turned = (symmetric(ca.vertsplit(part)) for part in (sums[6:12], sums[21:27]))
    own = body.of_twist(state.R)
    parts = [sums[:6], method.platform(state, body, g), -load.about_centre(motion.R)]
    if b.base is not None:
        parts.append(carried(b, method, state, b.base))
    if s.ligaments:
        parts.append(bearing(b, state))
    basis = twist_basis(motion, s.dependent)
    return Affine(
        H=own + ca.vertcat(ca.horzcat(mass, coupled.T), ca.horzcat(coupled, turned)),
        F=total(parts),
        start=motion.twist_rate,
        basis=basis,
        S=(motion.E @ motion.M_J)[list(basis.identity), :],
        B=ca.SX.eye(6),
        G=motion.frame.N,
        rows=[c.row for c in chains],
        rates=[c.motion.rate for c in chains],
        biases=[c.motion.acceleration for c in chains],
        chains=[c.motion for c in chains],
        parts=parts,
    )


@dataclass(frozen=True)
class _Chain:
    """The chains of one group, where the platform's accelerations are zero.

    terms: force and moment about O_M, then A_M, [r] A_M and [r] A_M [r]^T, (27,); of symmetric
           matrices the entries `UPPER`.
    """

    terms: ca.SX
    row: ca.SX
    motion: ChainDynamics


def _chain(b: Builder, group: int, state: State, g: ca.SX, effort: ca.SX) -> _Chain:
    family = FAMILIES[b.structure.families[group]]
    constants = family.named(b.lane(group, "constants"))
    M, A = state.point(b.lane(group, "joint")), ca.SX.sym("A", 3)
    chain = family.dynamics(constants, M.position, M.velocity, A, g)
    taken = chain.effort + loss(b, group, chain) - effort
    on_M = total(list(chain.forces.values())) + chain.J * taken
    slope = ca.jacobian(on_M, A)
    # A lane without a chain adds nothing, by its padding constants or by the mask.
    mask = ca.SX(1) if family.padding else b.lane(group, "mask")
    mass = mask * symmetric([slope[i, j] for i, j in UPPER])
    force = mass @ M.acceleration + mask * ca.substitute(on_M, A, ca.SX.zeros(3))
    lever = ca.skew(M.lever)
    coupled = lever @ mass
    turned = coupled @ lever.T
    terms = ca.vertcat(
        force,
        lever @ force,
        *(mass[i, j] for i, j in UPPER),
        ca.vec(coupled),
        *(turned[i, j] for i, j in UPPER),
    )
    acceleration = ca.substitute(chain.acceleration, A, M.acceleration)
    row = state.generalized_force(mask * chain.J, M.lever)
    return _Chain(terms, row, replace(chain, acceleration=acceleration))


def _by_derivatives(b: Builder, platform: PlatformState, load: Wrench, effort: Lanes) -> Affine:
    """The equations by derivatives of the sum, in the coordinates that the formulation chooses."""
    s, motion = b.structure, platform.motion
    twists = FORMULATIONS[s.formulation].uses_twist
    unknown = b.unknown("acceleration", 6)
    start = motion.twist_rate if twists else motion.acceleration
    turning = (
        replace(motion, twist_rate=unknown) if twists else replace(motion, acceleration=unknown)
    )
    moved = replace(platform, motion=turning)
    eq = equations(b, moved, load, route="core")
    assert eq.G is not None
    carried = b.total([c.row * t for c, t in zip(eq.chains, effort, strict=True)])
    Q = b.cut(eq.Q - carried)
    S = (motion.E @ motion.M_J)[list(eq.basis.identity), :] if twists else ca.SX.eye(s.m)
    F = b.at_zero(Q, unknown)
    return Affine(
        H=b.jacobian(Q, unknown),
        F=F,
        start=start,
        basis=eq.basis,
        S=S,
        B=eq.state.B,
        G=eq.G,
        rows=[c.row for c in eq.chains],
        rates=[c.dynamics.rate for c in eq.chains],
        biases=[b.at_zero(c.dynamics.acceleration, unknown) for c in eq.chains],
        chains=[c.dynamics for c in eq.chains],
        parts=[F],
    )
