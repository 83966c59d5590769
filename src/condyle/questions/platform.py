"""The platform on its contacts, in symbols: its pose, its motion, and the constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from ..kinematics.constraints import (
    Placement,
    closed_form,
    closed_form_available,
    contact_frame,
    independent_indices,
    indices,
    parasitic_jacobian,
    solve_small,
)
from ..kinematics.iteration import newton
from ..kinematics.parasitic import PlatformRates, motion_at, platform_rates
from ..kinematics.rotation import Bryant
from ..status import Status
from .builder import Builder, Lanes
from .numbers import contact_symbols, single_contacts

ANGLE_UNITS = "m, m, m, rad, rad, rad"
CERTAIN = 0.5  # minimum discriminant of a placement by iteration, which is 0 or 1


@dataclass(frozen=True)
class PlatformState:
    """The platform at one sample.

    q, q1, q2: independent coordinates and their rates, (m,) each.
    pose:      X_EE, (6,), the given angles as they are.
    """

    q: ca.SX
    q1: ca.SX
    q2: ca.SX
    pose: ca.SX
    placement: Placement
    motion: PlatformRates

    @property
    def R(self) -> ca.SX:
        return self.motion.R

    @property
    def position(self) -> ca.SX:
        """O_M, (3,)."""
        return self.placement.position


def closed(b: Builder, rates: int = 2) -> PlatformState:
    """The state from the independent coordinates, ports q, q1, q2: the contacts give the rest.

    Args: rates: how many of q' and q'' are ports; others are zero.
    """
    m = b.structure.m
    zero = ca.SX.zeros(m)
    names = enumerate(("q", "q1", "q2"))
    return platform_at(b, *(b.sample(n, m) if i <= rates else zero for i, n in names))


def platform_at(b: Builder, q: ca.SX, q1: ca.SX, q2: ca.SX) -> PlatformState:
    """The state from independent coordinates and rates, (m,) each: the contacts give the rest."""
    s = b.structure
    contacts = contact_symbols(s, b.parameter)
    if closed_form_available([form for form, _ in s.contacts], s.dependent):
        placement = closed_form(contacts, s.dependent, q, b.parameter("branch"))
    else:
        placement = newton(contacts, s.dependent, q, b.parameter("length"))
    motion = platform_rates(contacts, s.dependent, placement, q1, q2)
    pose = placement.pose()
    pose[independent_indices(s.dependent)] = q
    return PlatformState(q, q1, q2, pose, placement, motion)


def given(b: Builder, still: bool = False) -> PlatformState:
    """The state at a pose that meets the contacts, ports pose, pose_rate and pose_acceleration.

    Args: still: without the rates.
    """
    pose = b.sample("pose", 6, ANGLE_UNITS)
    zero = ca.SX.zeros(6)
    rate = zero if still else b.sample("pose_rate", 6)
    acceleration = zero if still else b.sample("pose_acceleration", 6)
    return at_pose(b, pose, rate, acceleration)


def at_pose(b: Builder, pose: ca.SX, rate: ca.SX, acceleration: ca.SX) -> PlatformState:
    """The state at a whole pose that meets the contacts, and rates that they admit, (6,) each."""
    s = b.structure
    bryant = Bryant.of(pose[3:])
    frame = contact_frame(contact_symbols(s, b.parameter), pose[:3], bryant.rotation())
    M_J = parasitic_jacobian(frame.N.T @ bryant.twist_jacobian(), s.dependent)
    motion = motion_at(frame, bryant, M_J, rate, acceleration)
    ind, placement = independent_indices(s.dependent), Placement(pose[:3], bryant, None)
    return PlatformState(pose[ind], rate[ind], acceleration[ind], pose, placement, motion)


def check_contacts(b: Builder, placement: Placement) -> None:
    """Check that the contacts are closed; where the iteration did not converge, repeat."""
    if placement.discriminant is not None:
        below = None if placement.iterated else Status.unreachable
        b.check(placement.discriminant, CERTAIN if placement.iterated else 0.0, below)


def feasibility(b: Builder, platform: PlatformState, chains: Lanes) -> ca.SX:
    """The smallest dimensionless discriminant: >= 0 where the pose can be reached.

    Args: chains: their discriminants.
    """
    least, placement = b.least(chains), platform.placement
    if placement.discriminant is None:
        return least
    # Where Newton did not converge the pose is not unreachable but unknown: 0, to be repeated.
    return (
        least * placement.discriminant
        if placement.iterated
        else ca.fmin(least, placement.discriminant)
    )


@dataclass(frozen=True)
class Contacts:
    """The contacts of one sample, one a column; N and T dual to the twist [V; omega].

    point, normal: centre of the ball and unit normal, (3, k).
    N: (6, k), wrench of unit normal forces;  T: (6, k), its reduction by friction.
    slip: (3, k), velocity of the material points [m/s];  drag: (3, k), mu u.
    """

    point: ca.SX
    normal: ca.SX
    N: ca.SX
    T: ca.SX
    slip: ca.SX
    drag: ca.SX

    def add_places(self, b: Builder) -> None:
        """Points and normals as outputs."""
        for name, vectors, unit in (("point", self.point, "m"), ("normal", self.normal, "1")):
            b.output(f"contact_{name}", vectors.T, unit, vectors.shape[1], 3)

    def add_wrenches(self, b: Builder, B: ca.SX) -> None:
        """N and T as outputs, dual to the rates c' with [V; omega] = B c'."""
        for name, wrenches in (("normal", self.N), ("friction", self.T)):
            b.output(name, (B.T @ wrenches).T, "", wrenches.shape[1], 6)

    def add_sliding(self, b: Builder) -> None:
        """Slip velocities and drag as outputs."""
        for name, vectors, unit in (("slip", self.slip, "m/s"), ("drag", self.drag, "1")):
            b.output(name, vectors.T, unit, vectors.shape[1], 3)


def contacts(b: Builder, platform: PlatformState) -> Contacts:
    """The contacts, some with friction."""
    position, V, omega = platform.position, platform.motion.twist[:3], platform.motion.twist[3:]
    frame = contact_frame(single_contacts(b.structure, b.parameter), position, platform.R)
    parts: list[tuple[ca.SX, ...]] = []
    for i, (gradient, r) in enumerate(zip(frame.gradients, frame.levers, strict=True)):
        n = gradient / ca.norm_2(gradient)
        mu, square, radius = ca.SX(0), ca.SX(1), ca.SX(0)
        if i in b.structure.friction:
            mu, square, radius = ca.vertsplit(b.parameter(f"friction_{i}"))
        c = r - radius * n  # where the ball touches
        v = V + ca.cross(omega, c)
        u = mu * v / ca.sqrt(ca.dot(v, v) + square)
        N, T = ca.vertcat(n, ca.cross(r, n)), ca.vertcat(u, ca.cross(c, u))
        parts.append((position + r, n, N, T, v, u))
    columns = zip(*parts, strict=True) if parts else [()] * 6
    rows = (3, 3, 6, 6, 3, 3)
    return Contacts(*(ca.horzcat(ca.SX(n, 0), *c) for n, c in zip(rows, columns, strict=True)))


@dataclass(frozen=True)
class Basis:
    """Pi, a basis of the admissible rates: identity rows, and `rest` for the other rows.

    Efforts do not depend on the choice of basis, so it can be a sparse one; inertia matrices do.
    """

    identity: Sequence[int]
    others: Sequence[int]
    rest: ca.SX

    def absolute(self) -> Basis:
        """|Pi|, entry by entry."""
        return Basis(self.identity, self.others, ca.fabs(self.rest))

    def generalized_force(self, f: ca.SX) -> ca.SX:
        """Pi^T f, with a column for each of f."""
        own = f[list(self.identity), :]
        return own + self.rest.T @ f[list(self.others), :] if len(self.others) else own

    def rates(self, w: ca.SX) -> ca.SX:
        """Pi w, with a column for each of w."""
        full = ca.SX(len(self.identity) + len(self.others), w.shape[1])
        full[list(self.identity), :] = w
        if len(self.others):
            full[list(self.others), :] = self.rest @ w
        return full


def twist_basis(motion: PlatformRates, dependent: Sequence[str]) -> Basis:
    """Twists with N^T [V; omega] = 0, the components at the places of `dependent` eliminated.

    At home R_omega is the identity, so they are determined as well as the coordinates are.
    """
    N, dep, ind = motion.frame.N, indices(dependent), independent_indices(dependent)
    return Basis(ind, dep, -solve_small(N[dep, :].T, N[ind, :].T))


def rate_basis(motion: PlatformRates, dependent: Sequence[str]) -> Basis:
    """M_J: the rates X_EE' by q_EE' ([Cheng2023] eq. 9)."""
    dep = indices(dependent)
    return Basis(independent_indices(dependent), dep, motion.M_J[dep, :])


def normal_forces(b: Builder, motion: PlatformRates, mu: ca.SX) -> ca.SX:
    """Forces along the unit normals, (k,), from multipliers of the contacts' gradients."""
    if b.structure.parallel:
        # mu_mean grad (phi_1 + phi_2) / 2 + mu_difference grad (phi_1 - phi_2)
        mu = ca.vertcat(mu[0] / 2 + mu[1], mu[0] / 2 - mu[1])
        return mu * motion.frame.n_length[0]
    return mu * motion.frame.n_length
