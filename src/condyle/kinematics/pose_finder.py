"""The pose finder: Gauss-Newton from a guess towards where something is prescribed of a pose.

What is prescribed, the joints' coordinates, contacts and a path, or measured points, belongs to
several poses. `NewtonSteps` has the unknowns and the equations s(X) = s, and with A = d s / d X a
step is A^+ (s - s(X)). `find` takes steps, or parts of them, from a guess; an `Acceptance` says
which.

`CONTINUATION`, for poses that a mechanism gets to from the guess without a leap, follows the flow
X' = A^+ (s - s(X)) in pieces. With as many conditions as freedoms, s(X) then goes to s on a
straight line. A piece is taken if

- it is a whole step, of at most a radian and a characteristic length, and the next one is at most
  a quarter as long; or it is short and comes nearer to what is prescribed;
- and its two ends invert each other, |1 - A_end^+ A_start| <= 1/2. Then every A between the two
  matrices has full rank, and with as many conditions as freedoms the sign of det A stays: no
  singularity, where branches meet, is leapt over.

Other pieces are halved. Both are tests at the ends of a piece, with a factor in hand; neither is
computed over an interval, so they are no proof.

The others leap, and leave it to the caller to judge the pose: `SHRINKING` takes whole steps as long
as they shrink, `BOLD` any, and `DAMPED` is for random guesses.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields

import numpy as np

from ..progress import spent

Array = np.ndarray

SHRINK = 0.25  # a step over the step before
LONGEST = 1.0  # piece, in characteristic lengths and radians,
SHORT = 0.25  # and one that need not shrink the step to a quarter
WORSE = 2.0  # error over the one before that is taken,
DAMPED_LONGEST, HALVINGS = 0.5, 4  # and any after so many halvings of a step of at most that
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


@dataclass(frozen=True)
class Acceptance:
    """Which pieces of steps are taken.

    accepts:  whether a piece is, (N,): of the steps at its start and at its end, and its part of
              the whole step, (N,).
    rounds:   maximum number of pieces tried.
    longest:  piece, in characteristic lengths and radians.
    smallest: part of a step, below which a sample has no pose; pieces not accepted are halved.
    growth:   of the part, after a piece that was accepted.
    """

    accepts: Callable[[NewtonStep, NewtonStep, Array], Array]
    rounds: int
    longest: float = np.inf
    smallest: float = 1.0
    growth: float = 1.0


def _continuous(step: NewtonStep, after: NewtonStep, part: Array) -> Array:
    nearer = (part * step.size <= SHORT) & (after.error < step.error)
    shrinks = (after.size <= SHRINK * step.size) | ((part < 1) & nearer)
    return shrinks & (unlikeness(step.A, after.A) <= ALIKE)


def _shrinks(step: NewtonStep, after: NewtonStep, part: Array) -> Array:
    return (after.size < step.size) & ~step.settled


def _any(step: NewtonStep, after: NewtonStep, part: Array) -> Array:
    return ~step.settled


def _damped(step: NewtonStep, after: NewtonStep, part: Array) -> Array:
    halved = part * np.maximum(step.size / DAMPED_LONGEST, 1) <= 0.5**HALVINGS
    return (halved | (after.error <= WORSE * step.error)) & ~step.settled


CONTINUATION = Acceptance(_continuous, 200, LONGEST, 2.0**-10, 2.0)
SHRINKING = Acceptance(_shrinks, 40)
BOLD = Acceptance(_any, 40)
DAMPED = Acceptance(_damped, 60, DAMPED_LONGEST, 0.0, np.inf)


@np.errstate(divide="ignore")
def find(
    steps: NewtonSteps, start: Array, prescribed: Array, acceptance: Acceptance = CONTINUATION
) -> tuple[Array, Array]:
    """Poses (N, 6) from `start`, (N, 6), towards values (N, r), as far as that goes, and whether to
    the end, (N,): there the values are nearest to the prescribed ones.

    Samples never influence each other, unless a `budget` is spent: then all that are left stop.
    """
    pose, piece, reached = start.copy(), np.ones(len(start)), np.zeros(len(start), dtype=bool)
    step = steps.step(pose, prescribed)
    active = np.flatnonzero(np.isfinite(step.size))
    step = step.of(active)
    for _ in range(acceptance.rounds):
        if not active.size or spent():
            break
        part = np.minimum(np.minimum(piece[active], 1.0), acceptance.longest / step.size)
        x = pose[active] + step.move * part[:, None]
        after = steps.step(x, prescribed[active])
        ok = acceptance.accepts(step, after, part)
        # Near a singularity rounding of the values makes steps that do not shrink.
        still = (step.size <= CONVERGED) | (step.settled & ~ok)
        reached[active[still]] = True
        pose[active[ok]] = x[ok]
        step.put(ok, after.of(ok))
        piece[active] = np.where(ok, acceptance.growth * part, part / 2)
        going = ~still & (piece[active] >= acceptance.smallest) & np.isfinite(step.size)
        active, step = active[going], step.of(going)
    return pose, reached


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
