"""The platform on its contacts, in symbols: where it is, how it moves, what the contacts allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from ..kinematics.constraints import (
    Placement,
    closed_form,
    closed_form_available,
    contact_frame,
    indices,
    parasitic_jacobian,
    solve_small,
)
from ..kinematics.iteration import newton
from ..kinematics.parasitic import WholeMotion, angular_bias, whole_motion
from ..kinematics.rotation import Bryant
from .builder import Builder
from .numbers import contact_symbols

ANGLE_UNITS = "m, m, m, rad, rad, rad"


@dataclass(frozen=True)
class Platform:
    """The platform at one sample.

    q, q1, q2: independent coordinates and their rates, (m,) each.
    pose:      X_EE, (6,), the given angles as they are.
    """

    q: ca.SX
    q1: ca.SX
    q2: ca.SX
    pose: ca.SX
    placement: Placement
    motion: WholeMotion

    @property
    def R(self) -> ca.SX:
        return self.motion.R


def closed(b: Builder, rates: int = 2) -> Platform:
    """From the independent coordinates, ports q, q1 and q2: the contacts give the rest.

    Args: rates: how many of q' and q'' are ports; others are zero.
    """
    s = b.structure
    zero = ca.SX.zeros(s.m)
    q, q1, q2 = (b.sample(n, s.m) if i <= rates else zero for i, n in enumerate(("q", "q1", "q2")))
    contacts = contact_symbols(s, b.parameter)
    if closed_form_available([form for form, _ in s.contacts], s.dependent):
        placement = closed_form(contacts, s.dependent, q, b.parameter("branch"))
    else:
        placement = newton(contacts, s.dependent, q)
    motion = whole_motion(contacts, s.dependent, placement, q1, q2)
    pose = placement.pose()
    pose[independent_indices(s.dependent)] = q
    return Platform(q, q1, q2, pose, placement, motion)


def given(b: Builder, still: bool = False) -> Platform:
    """From a whole pose that meets the contacts, ports pose, pose_rate and pose_acceleration.

    Args: still: without the rates.
    """
    s = b.structure
    pose = b.sample("pose", 6, ANGLE_UNITS)
    zero = ca.SX.zeros(6)
    rate = zero if still else b.sample("pose_rate", 6)
    acceleration = zero if still else b.sample("pose_acceleration", 6)
    bryant = Bryant.of(pose[3:])
    placement = Placement(pose[:3], bryant, None)
    contacts = contact_symbols(s, b.parameter)
    R, R_omega = bryant.rotation(), bryant.angular_velocity()
    frame = contact_frame(contacts, pose[:3], R)
    E = ca.diagcat(ca.SX.eye(3), R_omega)
    turning = angular_bias(bryant, rate[3:])
    twist_rate = ca.vertcat(acceleration[:3], R_omega @ acceleration[3:] + turning)
    M_J = parasitic_jacobian(frame.N.T @ E, s.dependent)
    motion = WholeMotion(rate, acceleration, E @ rate, twist_rate, M_J, E, R, frame)
    ind = independent_indices(s.dependent)
    return Platform(pose[ind], rate[ind], acceleration[ind], pose, placement, motion)


def independent_indices(dependent: Sequence[str]) -> list[int]:
    """Positions of the other pose coordinates in X_EE."""
    dep = indices(dependent)
    return [i for i in range(6) if i not in dep]


@dataclass(frozen=True)
class Basis:
    """Pi, the rates that the contacts allow: identity rows, and `rest` for the other rows.

    Efforts do not depend on which basis it is, so it can be a sparse one; inertia matrices do.
    """

    identity: Sequence[int]
    others: Sequence[int]
    rest: ca.SX

    def generalized_force(self, f: ca.SX) -> ca.SX:
        """Pi^T f, with a column for each of f."""
        own = f[list(self.identity), :]
        return own + self.rest.T @ f[list(self.others), :] if len(self.others) else own

    def rates(self, w: ca.SX) -> ca.SX:
        """Pi w, with a column for each of w."""
        found = ca.SX(len(self.identity) + len(self.others), w.shape[1])
        found[list(self.identity), :] = w
        if len(self.others):
            found[list(self.others), :] = self.rest @ w
        return found


def twist_basis(motion: WholeMotion, dependent: Sequence[str]) -> Basis:
    """Twists with N^T [V; omega] = 0, by the components that stand where `dependent` do at home.

    At home R_omega is the identity, so they are determined as well as the coordinates are.
    """
    N, dep, ind = motion.frame.N, indices(dependent), independent_indices(dependent)
    return Basis(ind, dep, -solve_small(N[dep, :].T, N[ind, :].T))


def rate_basis(motion: WholeMotion, dependent: Sequence[str]) -> Basis:
    """M_J: the rates X_EE' by q_EE' ([Cheng2023] eq. 9)."""
    dep = indices(dependent)
    return Basis(independent_indices(dependent), dep, motion.M_J[dep, :])


def whole_basis(size: int) -> Basis:
    """Every rate is free."""
    return Basis(range(size), [], ca.SX(0, size))


def normal_forces(b: Builder, motion: WholeMotion, mu: ca.SX) -> ca.SX:
    """Forces along the unit normals, (k,), from multipliers of the contacts' gradients."""
    if b.structure.parallel:
        # mu_mean grad (phi_1 + phi_2) / 2 + mu_difference grad (phi_1 - phi_2)
        mu = ca.vertcat(mu[0] / 2 + mu[1], mu[0] / 2 - mu[1])
        return mu * motion.frame.n_length[0]
    return mu * motion.frame.n_length
