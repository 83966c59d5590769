"""From a pose to the pose of other joint coordinates, without a leap.

Joint coordinates of most mechanisms belong to several poses, its assembly modes; which one a
mechanism takes is a matter of how it got there. So a pose is followed along the flow of
Gauss-Newton, X' = A^+ (theta - theta(X)), in pieces: parts of a Gauss-Newton step. With as many
joints as freedoms, joint coordinates then go to the given ones on a straight line. A piece is taken
if

- it is a whole step, of at most a radian and a characteristic length, and the next one is at most
  a quarter as long; or it is short and comes nearer to the joint coordinates;
- and its two ends invert each other, |1 - A_end^+ A_start| <= 1/2. Then every A between the two
  matrices has full rank, and with as many joints as freedoms the sign of det A stays: no
  singularity, where modes meet, is leapt over.

Other pieces are halved. Both are tests at the ends of a piece, with a factor in hand; neither is
computed over an interval, so they are no proof.
"""

from __future__ import annotations

import numpy as np

from .gauss_newton import GaussNewton, least_squares

SMALLEST_PIECE = 2.0**-10  # of a step
PIECES = 200
ITERATIONS = 40
SHRINK = 0.25  # a step over the step before
LONGEST = 1.0  # piece, in characteristic lengths and radians,
SHORT = 0.25  # and one that need not shrink the step to a quarter
CONVERGED = 1e-12  # step, likewise
ALIKE = 0.5  # of |1 - A_end^+ A_start|


def follow(
    newton: GaussNewton, start: np.ndarray, joints: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Poses (N, 6) followed from `start`, (N, 6), towards joint coordinates (N, n), as far as
    that goes, and whether to the end, (N,): there the joints are nearest to the given ones.

    Samples never influence each other.
    """
    pose, piece, reached = start.copy(), np.ones(len(start)), np.zeros(len(start), dtype=bool)
    step = newton.step(pose, joints)
    active = np.flatnonzero(np.isfinite(step.size))
    step = step.of(active)
    for _ in range(PIECES):
        if not active.size:
            break
        part = np.minimum(piece[active], LONGEST / np.maximum(step.size, LONGEST))
        x = pose[active] + step.move * part[:, None]
        new = newton.step(x, joints[active])
        nearer = (part * step.size <= SHORT) & (new.error < step.error)
        ok = (new.size <= SHRINK * step.size) | ((part < 1) & nearer)
        ok &= unlikeness(step.A, new.A) <= ALIKE
        # Near a singularity rounding of the joints makes steps that do not shrink.
        still = (step.size <= CONVERGED) | (step.settled & ~ok)
        reached[active[still]] = True
        pose[active[ok]] = x[ok]
        step.put(ok, new.of(ok))
        piece[active] = np.where(ok, 2 * part, part / 2)
        going = ~still & (piece[active] >= SMALLEST_PIECE)
        active, step = active[going], step.of(going)
    return pose, reached


def nearest(
    newton: GaussNewton, start: np.ndarray, joints: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where plain Gauss-Newton gets, (N, 6), and whether it converges, (N,): a leap, if need be."""
    pose, converged = start.copy(), np.zeros(len(start), dtype=bool)
    last, active = np.full(len(start), np.inf), np.arange(len(start))
    for _ in range(ITERATIONS):
        if not active.size:
            break
        step = newton.step(pose[active], joints[active])
        shrinks = step.size < last[active]
        pose[active[shrinks]] += step.move[shrinks]
        last[active] = step.size
        small = (step.size <= CONVERGED) | step.settled
        converged[active] = small
        active = active[shrinks & ~small]
    return pose, converged


def unlikeness(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """|1 - A_end^+ A_start|, (N,), in the norm of Frobenius, which is never too small."""
    with np.errstate(invalid="ignore", over="ignore"):
        rest = np.eye(end.shape[2]) - least_squares(end, start)
        size = np.sqrt((rest**2).sum(axis=(1, 2)))
    return np.where(np.isfinite(size), size, np.inf)
