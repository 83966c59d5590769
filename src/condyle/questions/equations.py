"""The equations of motion of a structure: the one place where they are put together.

    Pi^T Q = (J Pi)^T tau,     Q - J^T tau = G mu,

where Q (inertia less gravity less load) and the rows of J are dual to the coordinates of the
state, Pi maps the rates that the contacts allow to the state's, and the contacts act along G. The
route decides the state: `direct` works in q_EE itself (Model 1: Pi = E), `core` in the six
coordinates of the mechanism without contacts (Model 2: Pi = M_J, or the same in twists).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import casadi as ca

from ..dynamics import FORMULATIONS
from ..dynamics.formulation import Formulation, PlatformBody
from ..dynamics.least_norm import TINY
from ..kinematics.chain import FAMILIES, ChainDynamics, Constants, Family
from ..kinematics.constraints import indices, solve_small
from ..kinematics.moving_base import MovingBase
from ..kinematics.state import PointMotion, State, pose_state, twist_state
from .builder import Builder, Lanes
from .passive import PASSIVE, bearing
from .platform import (
    Basis,
    PlatformState,
    normal_forces,
    rate_basis,
    twist_basis,
)
from .structure import Structure

LOAD, ACTUATORS, FRICTION, INTERNAL = "load", "actuators", "friction", "internal"
BASE = "base"


@dataclass(frozen=True)
class Wrench:
    """The load on the platform, ports force, moment and point: (3,) each, the point in {M}."""

    force: ca.SX
    moment: ca.SX
    point: ca.SX

    @staticmethod
    def of(b: Builder) -> Wrench:
        ports = (("force", "N"), ("moment", "N m"), ("point", "m"))
        return Wrench(*(b.sample(name, 3, unit) for name, unit in ports))

    def about_centre(self, R: ca.SX) -> ca.SX:
        """[F; r x F + M] in {S}, (6,) ([Cheng2023] eq. 42)."""
        return ca.vertcat(self.force, ca.cross(R @ self.point, self.force) + self.moment)


@dataclass(frozen=True)
class ChainTerms:
    """Contributions of the chains of one group, lane by lane, dual to the state's rates.

    loss: the actuator's own effort, for its rotor and friction.
    """

    dynamics: ChainDynamics
    forces: dict[str, ca.SX]
    row: ca.SX
    loss: ca.SX


@dataclass(frozen=True)
class Equations:
    """The equations of one sample.

    parts:  name -> generalized force of the bodies of that name, (s,); they sum up to Q.
    chains: rows of J, and the joints' motion, one a group.
    G:      (s, k), along which the contacts act; None on route direct, which has no equations
            across them.
    """

    b: Builder
    state: State
    basis: Basis
    parts: dict[str, ca.SX]
    chains: list[ChainTerms]
    G: ca.SX | None

    @property
    def Q(self) -> ca.SX:
        return total(list(self.parts.values()))

    @property
    def A(self) -> Lanes:
        """Rows of J Pi, one a group."""
        return [self.basis.generalized_force(c.row) for c in self.chains]

    def contact_forces(self, platform: PlatformState, effort: Lanes) -> ca.SX:
        """lambda along the unit normals, (k,), from the dependent rows of G mu = Q - J^T tau."""
        assert self.G is not None
        dep = indices(self.b.structure.dependent)
        if not dep:
            return ca.SX(0, 1)
        mu = solve_small(self.G[dep, :], self.Q[dep] - self.carried(effort)[dep])
        return normal_forces(self.b, platform.motion, mu)

    def carried(self, effort: Lanes) -> ca.SX:
        """J^T tau, (s,)."""
        rows = zip(self.chains, effort, strict=True)
        return self.b.total([c.row * tau for c, tau in rows])

    def force_cancellation(self, effort: Lanes) -> ca.SX:
        """Square of what contacts would bear if efforts and other forces did not cancel, over what
        they bear; at least 1."""
        dep = indices(self.b.structure.dependent)
        unit = ca.vertcat(*(1 / self.b.parameter("length") if i >= 3 else ca.SX(1) for i in dep))
        rows = zip(self.chains, effort, strict=True)
        terms = self.b.total([ca.fabs(c.row[dep] * tau) for c, tau in rows])
        terms = reduce(add, (ca.fabs(part[dep]) for part in self.parts.values()), terms)
        left = ca.sumsqr(unit * (self.Q - self.carried(effort))[dep])
        return ca.fmax(1, ca.sumsqr(unit * terms) / (left + TINY))


def equations(
    b: Builder,
    platform: PlatformState,
    load: Wrench,
    formulation: str | None = None,
    route: str | None = None,
    lump: bool = False,
    low_latency: bool = False,
    state: State | None = None,
) -> Equations:
    """The equations of motion.

    Args: formulation, route: if not those of the structure.
          lump: each chain's bodies act as one, with end masses that are part of the platform.
          low_latency: a shorter critical path with more operations.
          state: if not that of route and formulation.
    """
    s = b.structure
    method = FORMULATIONS[formulation or s.formulation]
    motion, dependent = platform.motion, s.dependent
    frame = motion.frame
    G: ca.SX | None
    if state is not None:
        basis, G = rate_basis(motion, dependent), state.B.T @ frame.N
    elif (route or s.route) == "direct":
        pose = platform.placement.pose()
        state = pose_state(pose, platform.q1, platform.q2, platform.q)
        basis, G = Basis(range(s.m), [], ca.SX(0, s.m)), None
    elif method.uses_twist:
        position = platform.placement.position
        state = twist_state(position, motion.R, motion.twist, motion.twist_rate)
        basis, G = twist_basis(motion, dependent), frame.N
    else:
        given = (platform.placement.pose(), motion.rate, motion.acceleration)
        state = pose_state(*(b.cut(v) for v in given))
        basis, G = rate_basis(motion, dependent), motion.E.T @ frame.N
    g = b.gravity
    chains = [
        _chain_terms(b, group, method, state, g, lump, low_latency)
        for group in range(len(s.chains))
    ]
    parts = {"platform": method.platform(state, platform_body(b, lump), g)}
    parts |= _summed(b, chains, lump)
    if s.losses:
        # Efforts bear these too: J^T effort = J^T tau + J^T loss.
        parts[ACTUATORS] = b.total([c.row * c.loss for c in chains])
    if b.base is not None:
        parts[BASE] = carried(b, method, state, b.base)
    if s.ligaments or s.walls:
        parts[PASSIVE] = bearing(b, state)
    parts[LOAD] = -(state.B.T @ load.about_centre(state.R))
    return Equations(b, state, basis, parts, chains, G)


def carried(b: Builder, method: Formulation, state: State, base: MovingBase) -> ca.SX:
    """What a moving base adds to the inertia of all bodies, (s,)."""
    forces = []
    for group, kind in enumerate(b.structure.families):
        family, M = FAMILIES[kind], state.point(b.lane(group, "joint"))
        on_M = method.carried_chain(family, family.named(b.lane(group, "constants")), M, base)
        forces.append(state.generalized_force(b.lane(group, "mask") * on_M, M.lever))
    return state.B.T @ platform_body(b, lumped=False).carried(state, base) + b.total(forces)


def part_names(structure: Structure) -> tuple[str, ...]:
    """Parts of the efforts: platform, links of the chains, actuators, moving base, passive, load,
    friction.

    Each is the minimum-norm effort of its generalized force. Where the efforts differ from their
    sum, because friction depends on them or limits bind, the rest is internal: it does no work.
    """
    actuators = (ACTUATORS,) if structure.losses else ()
    base = (BASE,) if BASE in structure.given else ()
    passive = (PASSIVE,) if structure.ligaments or structure.walls else ()
    friction = (FRICTION, INTERNAL) if structure.friction else ()
    return ("platform", *_links(structure), *actuators, *base, *passive, LOAD, *friction)


def _links(structure: Structure) -> tuple[str, ...]:
    links: dict[str, None] = {}
    for kind in structure.families:
        links.update(dict.fromkeys(reversed(FAMILIES[kind].bodies)))
    return tuple(links)


def _chain_terms(
    b: Builder,
    group: int,
    method: Formulation,
    state: State,
    g: ca.SX,
    lump: bool,
    low_latency: bool,
) -> ChainTerms:
    family = FAMILIES[b.structure.families[group]]
    constants: Constants = family.named(b.lane(group, "constants"))
    M = state.point(b.lane(group, "joint"))
    b.waist(M.position, M.velocity, M.acceleration)
    if lump:
        dynamics, force = _lumped(family, constants, M, g, low_latency)
        forces = {"chains": force}
    else:
        dynamics = method.chain(family, constants, M, g)
        forces = dynamics.forces
    if not (method.pads and family.padding):
        # A lane without a chain has neither J nor force; else its padding constants ensure that.
        mask = b.lane(group, "mask")
        forces = {name: mask * f for name, f in forces.items()}
        dynamics = replace(dynamics, J=mask * dynamics.J)
    pulled = {name: state.generalized_force(f, M.lever) for name, f in forces.items()}
    row = state.generalized_force(dynamics.J, M.lever)
    return ChainTerms(dynamics, pulled, row, loss(b, group, dynamics))


def loss(b: Builder, group: int, motion: ChainDynamics) -> ca.SX:
    """Effort of an actuator for its own rotor and friction [N m or N]."""
    if not b.structure.losses:
        return ca.SX(0)
    inertia, viscous, coulomb, square = ca.vertsplit(b.lane(group, "actuator"))
    rate = motion.rate
    direction = rate / ca.sqrt(rate * rate + square)
    return inertia * motion.acceleration + viscous * rate + coulomb * direction


def _lumped(
    family: Family, c: Constants, M: PointMotion, g: ca.SX, low_latency: bool
) -> tuple[ChainDynamics, ca.SX]:
    """A chain's dynamics, and all its force on M but that of its end masses, (3,).

    With low latency the force is ready one step after the joint's acceleration, of which it is an
    affine function; that takes a few operations more.
    """
    held: list[ca.SX] = []
    acceleration = ca.SX.sym("acceleration")

    def cut(value: ca.SX) -> ca.SX:
        held.append(value)
        return acceleration

    dynamics = family.dynamics(
        c, M.position, M.velocity, M.acceleration, g, cut if low_latency else ca.SX
    )
    force = total(list(dynamics.forces.values())) + dynamics.J * dynamics.effort
    if held:
        slope = ca.jacobian(force, acceleration)
        rest = ca.substitute(force, acceleration, 0)
        dynamics = replace(dynamics, acceleration=held[0])
        force = rest + slope * held[0]
    return dynamics, force


def platform_body(b: Builder, lumped: bool) -> PlatformBody:
    """The platform, alone or with the end masses of the chains as part of it."""
    mass, first, i = (
        b.parameter(f"{'lumped_' if lumped else ''}{name}")
        for name in ("mass", "first_moment", "inertia")
    )
    return PlatformBody(mass, first, symmetric(ca.vertsplit(i)))


def symmetric(entries: Sequence[ca.SX]) -> ca.SX:
    """The matrix, (3, 3), of entries xx, yy, zz, xy, xz, yz."""
    return ca.vertcat(*(ca.horzcat(*(entries[k] for k in row)) for row in _SYMMETRIC))


_SYMMETRIC = ((0, 3, 4), (3, 1, 5), (4, 5, 2))


def _summed(b: Builder, chains: Sequence[ChainTerms], lumped: bool) -> dict[str, ca.SX]:
    """Forces of the chains' bodies, summed over the chains: by body, or all in one."""
    size = chains[0].row.shape[0]
    if lumped:
        return {"chains": b.total([total(list(c.forces.values())) for c in chains])}
    names = _links(b.structure)
    return {n: b.total([c.forces.get(n, ca.SX.zeros(size)) for c in chains]) for n in names}


def total(terms: Sequence[ca.SX]) -> ca.SX:
    """The sum; 0 if there are no terms, as of a family without bodies."""
    return reduce(add, terms) if terms else ca.SX(0)
