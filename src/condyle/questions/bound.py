"""How good an answer is: an estimate, on the safe side, of its relative error.

Rounding of the data and of every operation, of some u = 1.1e-16, reaches an answer through three
solves, and each multiplies it by no more than the reciprocal of a volume: the determinant of a
matrix whose columns were made of length one, which is 1 where they are orthogonal, tends to 0 with
the distance to a singular matrix, and is a by-product of eliminations that are done anyway. For a
matrix A of m such columns |A^-1| <= (m / (m - 1))^((m - 1) / 2) / |det A| < 1.7 / |det A|.

    chains:    the least discriminant d, since joints follow from square roots of it and
               Jacobians and rates from powers of that root: u / d;
    contacts:  the volume c of the rows of C in the dependent coordinates: poses are
               off by u / c, and the Jacobian M_J and its rates by u e / c^2, where
               e = 1 + |X_EE|^2 in characteristic lengths and radians;
    equations: the volume V of the columns of A = J M_J, or of the inertia matrix.

    bound = SAFETY u e / (d c^2 V)

Errors count relative to the largest entry of the answer, or to the largest of its terms where they
cancel: gravity, load, accelerations, rates, each alone. Every factor is an upper bound of
first-order perturbation theory, but SAFETY, which stands for the number of operations, was
measured: see `benchmarks/accuracy.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce
from operator import add
from typing import Any

import casadi as ca

from ..kinematics.constraints import determinant, indices, residuals, solve_small
from .builder import Builder, Lanes
from .numbers import contact_symbols
from .platform import Basis, PlatformState

ROUNDING = 2.0**-53
SAFETY = 100.0
TYPICAL = (1.0, 1.0, 1.0, 0.3, 0.1, 0.05)  # c of k contacts
CERTIFIED = 1e-9  # of efforts within limits, by their optimality conditions
TINY = 1e-300  # avoids 0 / 0 where nothing pulls


def square_volume(b: Builder, rows: ca.SX, dependent: Sequence[str]) -> ca.SX:
    """c^2 of the conditions rows . c' = 0, (k, 6), in the dependent coordinates.

    Args: rows: dual to lengths, then angles, which count as lengths.
    """
    dep = indices(dependent)
    if not dep:
        return ca.SX(1)
    inverse = 1 / b.parameter("length")
    unit = ca.vertcat(1, 1, 1, inverse, inverse, inverse)
    found = determinant(rows[:, dep]) * inverse ** sum(i >= 3 for i in dep)
    scaled = rows * ca.repmat(unit.T, len(dep), 1)
    sizes = ca.SX(1)
    for i in range(len(dep)):
        sizes = sizes * ca.sumsqr(scaled[i, :])
    return found * found / sizes


def beyond(square: ca.SX, k: int) -> ca.SX:
    """c^2, or c where that is larger than random contacts have it: they are far from a fold."""
    few = TYPICAL[k]
    return square if few == 1 else ca.fmin(ca.sqrt(square), square / few)


def square_spread(S: ca.SX) -> ca.SX:
    """Square of the volume of the rows of S, (m, m), those longer than one made of length one.

    A short row of angular rates is a gimbal lock, not a unit.
    """
    sizes = ca.SX(1)
    for i in range(S.shape[0]):
        sizes = sizes * ca.fmax(1, ca.sumsqr(S[i, :]))
    return determinant(S) ** 2 / sizes


def distance(K: ca.SX, force: ca.SX) -> ca.SX:
    """Of the equations (sigma - K) y = lambda_0 of friction from singular ones, in (0, 1]."""
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
    """e of a pose, at least 1: what closes contacts rounds by its size.

    Not counted: rounding of a profile's heights, which knots close together magnify.
    """
    if not b.structure.contacts:
        return ca.SX(1)
    inverse = 1 / b.parameter("length")
    pose = platform.pose
    return 1 + inverse * inverse * ca.sumsqr(pose[:3]) + ca.sumsqr(pose[3:])


def data_error(
    b: Builder, platform: PlatformState, discriminants: Lanes, left: ca.SX | None = None
) -> ca.SX:
    """Of the data of the equations: (u e / c^2 + r / c) / d.

    Args: discriminants: of the chains;  left: r^2, if not that of the platform's placement.
    """
    motion = platform.motion
    rest = platform.placement.left if left is None else left
    square = square_volume(b, motion.frame.N.T @ motion.E, b.structure.dependent)
    found = ROUNDING * _extent(b, platform) / beyond(square, len(b.structure.dependent))
    if not isinstance(rest, float):
        found = found + ca.sqrt(rest / square)
    return found / ca.fmin(b.least(discriminants), 1)


def uncancelled(basis: Basis, parts: Iterable[ca.SX]) -> ca.SX:
    """|Pi|^T sum |Q_part|, (m,): what generalized forces would be if nothing cancelled."""
    return basis.absolute().generalized_force(reduce(add, map(ca.fabs, parts)))


def cancellation(right: ca.SX, lengths: ca.SX, square: ca.SX) -> ca.SX:
    """Square of what a solution would be if nothing cancelled, over its own; at least 1.

    Args: right: of `uncancelled`;  lengths: squares of the columns' lengths;
          square: of the solution's length.
    """
    return ca.fmax(1, ca.sum1(right * right / lengths) / (square + TINY))


def bound(data: Any, lost: Any) -> Any:
    """The bound, of symbols or arrays.

    Args: data: of `data_error`;  lost: the factor of cancellation over V.
    """
    return SAFETY * data * lost
