"""From a pose to the pose where something else is prescribed, without a leap.

What is prescribed of a pose, the joints' coordinates or contacts and a path, belongs to several
poses; which one a mechanism takes is a matter of how it got there. So a pose is followed along the
flow of Gauss-Newton,

    X' = A^+ (s - s(X)),    A = d s / d X,

in pieces: parts of a Gauss-Newton step. With as many conditions as freedoms, s(X) then goes to s on
a straight line. A piece is taken if

- it is a whole step, of at most a radian and a characteristic length, and the next one is at most
  a quarter as long; or it is short and comes nearer to what is prescribed;
- and its two ends invert each other, |1 - A_end^+ A_start| <= 1/2. Then every A between the two
  matrices has full rank, and with as many conditions as freedoms the sign of det A stays: no
  singularity, where branches meet, is leapt over.

Other pieces are halved. Both are tests at the ends of a piece, with a factor in hand; neither is
computed over an interval, so they are no proof.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields

import numpy as np

from ..progress import spent

Array = np.ndarray

SMALLEST_PIECE = 2.0**-10  # of a step
PIECES = 200
ITERATIONS = 40
SHRINK = 0.25  # a step over the step before
LONGEST = 1.0  # piece, in characteristic lengths and radians,
SHORT = 0.25  # and one that need not shrink the step to a quarter
MOST = 2.0**20  # rad, beyond which an angle has lost the digits that tell where it is
CONVERGED = 1e-12  # step, likewise
ALIKE = 0.5  # of |1 - A_end^+ A_start|
ROUNDING = 4e-15  # of what is prescribed, in the mechanism's own size, with what A makes of it


@dataclass(frozen=True)
class Conditions:
    """What N poses make of what is prescribed.

    value: s(X), (N, r).   slope: d s / d f, (N, r, m), in the freedoms f.
    basis: (N, 6, m), X' = basis f'.
    back:  (N, 6), moves the pose back onto the contacts where f does not; carried: what that
           changes s by, (N, r).   off: (N, k) [m], how far the contacts are off their surfaces.
    """

    value: Array
    slope: Array
    basis: Array
    back: Array
    carried: Array
    off: Array


@dataclass(frozen=True)
class NewtonStep:
    """One Gauss-Newton step at N poses.

    move:     of X_EE, (N, 6); NaN where there is none.
    size:     its largest entry, (N,), in characteristic lengths and radians.
    residual: (N, r), prescribed less present values.
    error:    (N,), norm of the residual and of the distance from the surfaces [m].
    A:        (N, r, m), without dimension.
    settled:  (N,), whether the step changes values by no more than rounding.
    """

    move: Array
    size: Array
    residual: Array
    error: Array
    A: Array
    settled: Array

    def of(self, samples: Array) -> NewtonStep:
        """The steps of some samples, by index or mask."""
        return NewtonStep(*(getattr(self, f.name)[samples] for f in fields(self)))

    def put(self, samples: Array, other: NewtonStep) -> None:
        """Steps of some samples anew."""
        for f in fields(self):
            getattr(self, f.name)[samples] = getattr(other, f.name)


class NewtonSteps:
    """Gauss-Newton steps towards what is prescribed of one mechanism."""

    def __init__(
        self,
        conditions: Callable[[Array], Conditions],
        length: float,
        angles: Array,
        free: Array,
        turning: bool = False,
    ) -> None:
        """Args: length: the characteristic one [m].   angles: which values are angles, (r,).
        free: the freedoms that are coordinates of X_EE, by number, (m,).
        turning: whether angles' differences are taken without whole turns.
        """
        self.conditions: Callable[[Array], Conditions] = conditions
        self.length: float = length
        self._turning = angles if turning else np.zeros(len(angles), dtype=bool)
        self._weight = np.where(angles, 1.0, 1 / length)
        self._unit = np.repeat([length, 1.0], 3)
        self.free_unit: np.ndarray = self._unit[free]

    @np.errstate(all="ignore")
    def step(self, pose: Array, prescribed: Array) -> NewtonStep:
        """Steps from poses (N, 6) towards values (N, r)."""
        at = self.conditions(pose)
        residual = self._without_turns(prescribed - at.value)
        A = at.slope * self._weight[:, None] * self.free_unit
        dq = least_squares(A, ((residual - at.carried) * self._weight)[..., None])
        move = at.back + (at.basis @ (dq * self.free_unit[:, None]))[..., 0]
        change = np.abs(A @ dq)[..., 0]
        settled = (change <= ROUNDING * (1 + np.abs(A).sum(axis=2))).all(axis=1)
        settled &= (np.abs(at.off) <= ROUNDING * self.length).all(axis=1)
        squares = ((residual * self._weight * self.length) ** 2).sum(axis=1)
        error = np.sqrt(squares + (at.off**2).sum(axis=1))
        return NewtonStep(move, self.size(move), residual, error, A, settled)

    def scaled_basis(self, pose: Array) -> Array:
        """X' = basis f' at poses (N, 6), (N, 6, m), without dimension."""
        return self.conditions(pose).basis * self.free_unit / self._unit[:, None]

    def _without_turns(self, difference: Array) -> Array:
        turns = np.round(difference / (2 * np.pi)) * (2 * np.pi)
        known = np.where(np.abs(difference) < MOST, difference - turns, np.nan)
        return np.where(self._turning, known, difference)

    def between(self, one: Array, other: Array) -> Array:
        """The way from one pose to another, (N, 6), without whole turns."""
        way = other - one
        way[:, 3:] -= np.round(way[:, 3:] / (2 * np.pi)) * (2 * np.pi)
        return way

    def size(self, way: Array) -> Array:
        """Largest entry of ways of the pose, (N,), in characteristic lengths and radians."""
        return np.abs(way / self._unit).max(axis=1)


def follow(steps: NewtonSteps, start: Array, prescribed: Array) -> tuple[Array, Array]:
    """Poses (N, 6) followed from `start`, (N, 6), towards values (N, r), as far as that goes, and
    whether to the end, (N,): there the values are nearest to the prescribed ones.

    Samples never influence each other, unless a `budget` is spent: then all that are left stop.
    """
    pose, piece, reached = start.copy(), np.ones(len(start)), np.zeros(len(start), dtype=bool)
    step = steps.step(pose, prescribed)
    active = np.flatnonzero(np.isfinite(step.size))
    step = step.of(active)
    for _ in range(PIECES):
        if not active.size or spent():
            break
        part = np.minimum(piece[active], LONGEST / np.maximum(step.size, LONGEST))
        x = pose[active] + step.move * part[:, None]
        new = steps.step(x, prescribed[active])
        nearer = (part * step.size <= SHORT) & (new.error < step.error)
        ok = (new.size <= SHRINK * step.size) | ((part < 1) & nearer)
        ok &= unlikeness(step.A, new.A) <= ALIKE
        # Near a singularity rounding of the values makes steps that do not shrink.
        still = (step.size <= CONVERGED) | (step.settled & ~ok)
        reached[active[still]] = True
        pose[active[ok]] = x[ok]
        step.put(ok, new.of(ok))
        piece[active] = np.where(ok, 2 * part, part / 2)
        going = ~still & (piece[active] >= SMALLEST_PIECE)
        active, step = active[going], step.of(going)
    return pose, reached


def nearest(
    steps: NewtonSteps, start: Array, prescribed: Array, bold: bool = False
) -> tuple[Array, Array]:
    """Where plain Gauss-Newton gets, (N, 6), and whether it converges, (N,): a leap, if need be.

    Args: bold: steps may also grow.
    """
    pose, converged = start.copy(), np.zeros(len(start), dtype=bool)
    last, active = np.full(len(start), np.inf), np.arange(len(start))
    for _ in range(ITERATIONS):
        if not active.size:
            break
        step = steps.step(pose[active], prescribed[active])
        goes = np.isfinite(step.size) if bold else step.size < last[active]
        pose[active[goes]] += step.move[goes]
        last[active] = step.size
        small = (step.size <= CONVERGED) | step.settled
        converged[active] = small
        active = active[goes & ~small]
    return pose, converged


def unlikeness(start: Array, end: Array) -> Array:
    """|1 - A_end^+ A_start|, (N,), in the norm of Frobenius, which is never too small."""
    with np.errstate(invalid="ignore", over="ignore"):
        rest = np.eye(end.shape[2]) - least_squares(end, start)
        size = np.sqrt((rest**2).sum(axis=(1, 2)))
    return np.where(np.isfinite(size), size, np.inf)


def least_squares(A: Array, b: Array) -> Array:
    """x with A x ~ b for each sample, (N, m, c) from (N, n, m) and (N, n, c); NaN where A fails."""
    x = np.full((len(A), A.shape[2], b.shape[2]), np.nan)
    good = np.flatnonzero(np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=(1, 2)))
    if not good.size:
        return x
    square, right = A[good], b[good]
    if A.shape[1] > A.shape[2]:
        Q, square = np.linalg.qr(square)
        right = Q.transpose(0, 2, 1) @ right
    try:
        x[good] = np.linalg.solve(square, right)
    except np.linalg.LinAlgError:
        for i, R, y in zip(good, square, right, strict=True):
            with suppress(np.linalg.LinAlgError):
                x[i] = np.linalg.solve(R, y)
    return x
