"""How good an answer is: an estimate, on the safe side, of its relative error.

Rounding of the data and of every operation, of some u = 1.1e-16, reaches an answer through three
solves, and each multiplies it by no more than the reciprocal of a volume: the determinant of a
matrix whose columns were made of length one, which is 1 where they are orthogonal, tends to 0 with
the distance to a singular matrix, and is a by-product of eliminations that are done anyway. For a
matrix A of m such columns |A^-1| <= (m / (m - 1))^((m - 1) / 2) / |det A| < 1.7 / |det A|.

    chains:    the least discriminant d, since joints follow from square roots of it and
               Jacobians and rates from powers of that root: u / d. Most of it is one factor of a
               chain's row and of its force, so that a solve does not magnify it; directions are
               off by u / d^(1/2), and forces of bodies that turn about their own axis by u / g,
               g the least cos(gamma_i)^2;
    contacts:  the volume c of the rows of C in the dependent coordinates: poses are
               off by p = u e / c and the Jacobian M_J and its rates by p / c, where
               e^2 = 1 + |X_EE|^2 in characteristic lengths and radians;
    equations: the volume V of the columns of A = J M_J, or of the inertia matrix.

    efforts:        S t [(u + p) / d + p / c + ((u + p) / d^(1/2) + u / g + u s) / V],
    accelerations:  S t [(u + p) / d + p / c + (u + p) / d^(1/2) + u / g + u / V] / (V w),

with t what an answer would be if nothing cancelled, over what it is, s the same of the terms of the
method that solves for efforts, and w the volume of what leads to q''. Errors add up: only what a
solve magnifies is multiplied. An inertia matrix is B^T B with V^2 its own volume; most of it is
off as B is, and what its sums round as V^2.

Errors count relative to the largest entry of the answer, or to the largest of its terms where they
cancel: gravity, load, accelerations, rates, each alone. Every factor is an upper bound of
first-order perturbation theory, but S, which stands for the number of operations, was measured for
each of the two: see `benchmarks/accuracy.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce
from operator import add
from typing import Any

import casadi as ca

from ..dynamics.least_norm import TINY
from ..kinematics.chain import ChainDynamics, ChainLoop
from ..kinematics.constraints import determinant, indices, residuals, solve_small
from .builder import Builder
from .numbers import contact_symbols
from .platform import Basis, PlatformState

ROUNDING = 2.0**-53
SAFETY, FORWARD_SAFETY = 60.0, 20.0  # S of efforts and of accelerations
TYPICAL = (1.0, 1.0, 1.0, 0.3, 0.3, 0.3)  # c of k contacts
CERTIFIED = 1e-9  # of efforts within limits, by their optimality conditions


def square_volume(b: Builder, rows: ca.SX, dependent: Sequence[str]) -> ca.SX:
    """c^2 of the conditions rows . c' = 0, (k, 6), in the dependent coordinates.

    Args: rows: dual to lengths, then angles, which count as lengths.
    """
    dep = indices(dependent)
    if not dep:
        return ca.SX(1)
    inverse = 1 / b.parameter("length")
    unit = ca.vertcat(1, 1, 1, inverse, inverse, inverse)
    volume = determinant(rows[:, dep]) * inverse ** sum(i >= 3 for i in dep)
    scaled = rows * ca.repmat(unit.T, len(dep), 1)
    sizes = ca.SX(1)
    for i in range(len(dep)):
        sizes = sizes * ca.sumsqr(scaled[i, :])
    return volume * volume / sizes


def beyond(square: ca.SX, k: int) -> ca.SX:
    """c^2 next to a fold; of three and more contacts c where c is what it usually is far from one,
    and in between c^3 over its square.
    """
    if (few := TYPICAL[k]) == 1:
        return square
    c = ca.sqrt(square)
    return ca.fmin(c, ca.fmax(square, square * c * (1 / few**2)))


def spread(S: ca.SX, k: int) -> ca.SX:
    """Volume of the rows of S, (m, m), those longer than one made of length one; or its root, as
    `beyond` has it.

    A short row of angular rates is a gimbal lock, not a unit.
    """
    sizes = ca.SX(1)
    for i in range(S.shape[0]):
        sizes = sizes * ca.fmax(1, ca.sumsqr(S[i, :]))
    return beyond(ca.fabs(determinant(S)) / ca.sqrt(sizes), k)


def distance(K: ca.SX, force: ca.SX) -> ca.SX:
    """How far the equations (sigma - K) y = lambda_0 of friction are from singular, in (0, 1]."""
    sizes = ca.SX(1)
    for i in range(K.shape[0]):
        sizes = sizes * (1 + ca.sum2(ca.fabs(K[i, :])))
    return ca.fabs(determinant(ca.diag(2 * (force >= 0) - 1) - K)) / sizes


def off_contacts(b: Builder, platform: PlatformState) -> ca.SX:
    """Square of the step onto the contacts at a given pose, in characteristic lengths and rad."""
    dep = indices(b.structure.dependent)
    C = (platform.motion.frame.N.T @ platform.motion.E)[:, dep]
    phi = residuals(contact_symbols(b.structure, b.parameter), platform.pose)
    inverse = 1 / b.parameter("length")
    unit = ca.vertcat(ca.SX(0, 1), *(inverse if i < 3 else ca.SX(1) for i in dep))
    return ca.sumsqr(unit * solve_small(C, phi)) if dep else ca.SX(0)


def _extent(b: Builder, platform: PlatformState) -> ca.SX:
    """e of a pose, at least 1: what closes contacts rounds by its size."""
    if not b.structure.contacts:
        return ca.SX(1)
    inverse = 1 / b.parameter("length")
    pose = platform.pose
    return ca.sqrt(1 + inverse * inverse * ca.sumsqr(pose[:3]) + ca.sumsqr(pose[3:]))


def data_error(
    b: Builder,
    platform: PlatformState,
    chains: Sequence[ChainDynamics | ChainLoop],
    left: ca.SX | None = None,
    held: ca.SX | float = 1.0,
) -> ca.SX:
    """Errors of the equations' data, (2,): what a solve leaves as it is, and what it magnifies.

    (u + p) / d + p / c and (u + p) / d^(1/2) + u / g, p = u e / c + r.

    Args: left: r^2, if not that of the platform's placement;
          held: square of the volume of the rows with friction, which counts as d does.
    """
    k, motion = len(b.structure.dependent), platform.motion
    rest = platform.placement.left if left is None else left
    position, slopes = ca.SX(0), ca.SX(0)
    if k:
        c = ca.sqrt(beyond(square_volume(b, motion.frame.N.T @ motion.E, b.structure.dependent), k))
        position = ROUNDING * _extent(b, platform) / c
        position = position if isinstance(rest, float) else position + ca.sqrt(rest)
        slopes = position / c
    rows = zip(*((chain.discriminant, chain.upright) for chain in chains), strict=True)
    d, g = (ca.fmin(b.least(lanes), 1) for lanes in rows)
    off = ROUNDING + position
    turned = ROUNDING / g + off / ca.sqrt(ca.fmin(d, held))
    return ca.vertcat(off / d + slopes, turned + _bent(b, platform))


def _bent(b: Builder, platform: PlatformState) -> ca.SX:
    """The curvature of the contacts' surfaces, times the characteristic length."""
    found = ca.SX(0)
    for contact in contact_symbols(b.structure, b.parameter):
        found = ca.fmax(found, contact.rounded(contact.at(platform.position, platform.R)))
    return ROUNDING / SAFETY * b.parameter("length") * found


def uncancelled(basis: Basis, parts: Iterable[ca.SX]) -> ca.SX:
    """|Pi|^T sum |Q_part|, (m,): what generalized forces would be if nothing cancelled."""
    return basis.absolute().generalized_force(reduce(add, map(ca.fabs, parts)))


def cancellation(right: ca.SX, lengths: ca.SX, square: ca.SX) -> ca.SX:
    """Square of what a solution would be if nothing cancelled, over its own; at least 1.

    Args: right: of `uncancelled`;  lengths: squares of the columns' lengths;
          square: of the solution's length.
    """
    return ca.fmax(1, ca.sum1(right * right / lengths) / (square + TINY))


def bound(
    data: Any, lost: Any = 1.0, volume: Any = 1.0, terms: Any = 1.0, safety: float = SAFETY
) -> Any:
    """The bound, of symbols or arrays.

    Args: data: of `data_error`, (2, ...);  lost: t;  volume: V;  terms: s;  safety: S.
    """
    return safety * lost * (data[0] + (data[1] + ROUNDING * (terms - 1)) / volume)


def forward_bound(data: Any, lost: Any, square: Any) -> Any:
    """The bound of accelerations. Args: data: sum of `data_error`;  lost: t / w;  square: V^2."""
    root = square**0.5
    return bound([data, ROUNDING], lost / root, root, safety=FORWARD_SAFETY)
