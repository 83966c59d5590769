"""Coulomb friction at the contacts: linear in their forces, once the signs of these are given.

At the point of contact, with v the velocity of the material point of the platform, the surface puts
-mu |lambda| u on the platform, u = v / sqrt(|v|^2 + s^2). With sigma = sign(lambda),

    Q = J^T tau + sum lambda_k D_k,    D_k = N_k - sigma_k T_k,    T_k = mu [u; c_k x u],

and a pattern sigma is consistent where sigma_k lambda_k >= 0. Wanted are the efforts of least norm
of all consistent patterns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import casadi as ca

from ..kinematics.contact import contact_frame, indices, solve_small
from .builder import Builder, Lanes
from .equations import Equations
from .numbers import single_contacts
from .platform import Basis, Platform, independent_indices

MOST = 2  # contacts with friction whose patterns are all solved in one kernel
HUGE = 1e300

LeastNorm = Callable[..., tuple[Lanes, ca.SX]]


@dataclass(frozen=True)
class Contacts:
    """The contacts of one sample, dual to the twist [V; omega].

    N: (6, k), wrench of unit normal forces;  T: (6, k), what friction takes off it.
    slip: (3, k), velocity of the material points [m/s];  drag: (3, k), mu u.
    """

    N: ca.SX
    T: ca.SX
    slip: ca.SX
    drag: ca.SX


def contacts(b: Builder, platform: Platform) -> Contacts:
    """Unit normals, and friction where there is some."""
    frame = contact_frame(
        single_contacts(b.structure, b.parameter), platform.placement.position, platform.R
    )
    V, omega = platform.motion.twist[:3], platform.motion.twist[3:]
    N, T, slips, drags = [], [], [], []
    for i, (gradient, r) in enumerate(zip(frame.gradients, frame.levers, strict=True)):
        n = gradient / ca.norm_2(gradient)
        mu, square, radius = ca.SX(0), ca.SX(1), ca.SX(0)
        if i in b.structure.friction:
            mu, square, radius = ca.vertsplit(b.parameter(f"friction_{i}"))
        c = r - radius * n  # where the ball touches
        v = V + ca.cross(omega, c)
        u = mu * v / ca.sqrt(ca.dot(v, v) + square)
        N.append(ca.vertcat(n, ca.cross(r, n)))
        T.append(ca.vertcat(u, ca.cross(c, u)))
        slips.append(v)
        drags.append(u)
    return Contacts(
        ca.horzcat(ca.SX(6, 0), *N),
        ca.horzcat(ca.SX(6, 0), *T),
        ca.horzcat(ca.SX(3, 0), *slips),
        ca.horzcat(ca.SX(3, 0), *drags),
    )


@dataclass(frozen=True)
class Chosen:
    """Efforts and contact forces of the best pattern.

    sure: 1 where no other pattern could be better, else 0;  pivots: of the weakest solve.
    """

    effort: Lanes
    force: ca.SX
    sure: ca.SX
    pivots: ca.SX


def least_norm_pattern(b: Builder, eq: Equations, c: Contacts, solve: LeastNorm) -> Chosen:
    """Every pattern's least norm; the least that is consistent."""
    s = b.structure
    dep, ind = indices(s.dependent), independent_indices(s.dependent)
    N, T = eq.state.B.T @ c.N, eq.state.B.T @ c.T
    best = ca.SX(float("inf"))
    tried: dict[tuple[int, ...], tuple[ca.SX, list[ca.SX]]] = {}
    pivots: ca.SX | None = None
    effort: Lanes = []
    force = ca.SX.zeros(len(dep))
    for signs in product((1, -1), repeat=len(s.friction)):
        D = ca.SX(N)
        for i, sign in zip(s.friction, signs, strict=True):
            D[:, i] = N[:, i] - sign * T[:, i]
        basis = Basis(ind, dep, -solve_small(D[dep, :].T, D[ind, :].T))
        rows = [basis.generalized_force(chain.row) for chain in eq.chains]
        found, quality = solve(b.total, rows, basis.generalized_force(eq.Q))
        carried = b.total([ch.row[dep] * t for ch, t in zip(eq.chains, found, strict=True)])
        lam = solve_small(D[dep, :], eq.Q[dep] - carried)
        norm = b.total([t * t for t in found])
        kept = [sign * lam[i] >= 0 for i, sign in zip(s.friction, signs, strict=True)]
        held = ca.SX(1)
        for one in kept:
            held = held * one
        tried[signs] = norm, kept
        better = held * (norm < best)
        best = ca.if_else(better, norm, best)
        force = ca.if_else(better, lam, force)
        effort = [
            t if not effort else ca.if_else(better, t, effort[g]) for g, t in enumerate(found)
        ]
        pivots = quality if pivots is None else ca.fmin(pivots, quality)
    assert pivots is not None
    return Chosen(effort, force, _sure(tried, best), pivots)


def _sure(tried: dict[tuple[int, ...], tuple[ca.SX, list[ca.SX]]], best: ca.SX) -> ca.SX:
    """Whether nothing with a contact force held at 0 is less than the best pattern: 1, else 0.

    Such a force belongs to both patterns that differ in its sign alone, and so is the least of
    both. Neither is less without the constraint, and from the least of a convex function within
    bounds the way to the least without them leaves a bound that is active: both patterns break the
    sign of the force that is 0. With two forces 0 all four patterns do, and then there is no best.

    Args: tried: norm of each pattern, and which signs its forces keep.
    """
    sure = best < HUGE
    for signs, (norm, kept) in tried.items():
        for i, sign in enumerate(signs):
            if sign > 0:
                other, others = tried[(*signs[:i], -1, *signs[i + 1 :])]
                neither = (1 - kept[i]) * (1 - others[i])
                sure = sure * (1 - neither * (ca.fmax(norm, other) < best))
    return sure
