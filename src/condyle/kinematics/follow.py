"""From a pose whose joints are known to the pose of other joint coordinates, without a leap.

Joint coordinates of most mechanisms belong to several poses, its assembly modes; which one a
mechanism takes is a matter of how it got there. So a pose is followed: joint coordinates go to the
given ones on a straight line, in pieces, and a piece is taken only if

- Gauss-Newton contracts: each step is at most a quarter of the last, and none longer than a
  radian or a characteristic length;
- the two ends invert each other, |1 - A_end^+ A_start| <= 1/2. Then every A between the two has
  full rank, so no singularity, where modes meet, lies between; with as many joints as freedoms,
  the sign of det A stays.

Pieces that fail are halved. Both conditions are computed at points, not over intervals: they are
tests, with a factor in hand, and no proof.
"""

from __future__ import annotations

import numpy as np

from .gauss_newton import GaussNewton, least_squares

SMALLEST_PIECE = 2.0**-10  # of the way
ITERATIONS = 40
SHRINK = 0.25  # a step over the step before
LONGEST = 1.0  # step, in characteristic lengths and radians
CONVERGED = 1e-12  # likewise
ALIKE = 0.5  # of |1 - A_end^+ A_start|


def follow(
    newton: GaussNewton, start: np.ndarray, joints: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Poses (N, 6) followed from `start`, (N, 6), to joint coordinates (N, n); where reached, (N,).

    Samples never influence each other.
    """
    pose, done, piece = start.copy(), np.zeros(len(start)), np.ones(len(start))
    origin = newton.joints(start)
    way = newton.turn(joints - origin)
    active = np.flatnonzero(np.isfinite(way).all(axis=1))
    while active.size:
        goal = np.minimum(done[active] + piece[active], 1.0)
        target = origin[active] + way[active] * goal[:, None]
        x, ok = converge(newton, pose[active], target)
        pose[active[ok]], done[active[ok]] = x[ok], goal[ok]
        piece[active] *= np.where(ok, 2.0, 0.5)
        active = active[(done[active] < 1) & (piece[active] >= SMALLEST_PIECE)]
    return pose, done == 1


def converge(
    newton: GaussNewton, x: np.ndarray, joints: np.ndarray, bold: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Newton from poses x, (N, 6), in steps that contract; where that went well, (N,).

    Args: bold: any pose will do, however far.
    """
    shrink = 1.0 if bold else SHRINK
    x, last = x.copy(), np.full(len(x), np.inf)
    converged = np.zeros(len(x), dtype=bool)
    active = np.arange(len(x))
    for iteration in range(ITERATIONS):
        step = newton.step(x[active], joints[active])
        if iteration == 0:
            first, final = step.A, step.A.copy()
        final[active] = step.A
        finite = np.isfinite(step.size)
        x[active[finite]] += step.move[finite]
        # Near a singularity rounding of the joints makes steps that do not shrink.
        stalled = step.size > shrink * last[active]
        converged[active] = (step.size <= CONVERGED) | (stalled & step.settled)
        last[active] = step.size
        going = finite & ~converged[active] & ~stalled & (step.size <= LONGEST)
        active = active[going]
        if not active.size:
            break
    if not bold:
        converged &= unlikeness(first, final) <= ALIKE
    return x, converged


def unlikeness(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """|1 - A_end^+ A_start|, (N,), in the norm of Frobenius, which is never too small."""
    with np.errstate(invalid="ignore", over="ignore"):
        rest = np.eye(end.shape[2]) - least_squares(end, start)
        size = np.sqrt((rest**2).sum(axis=(1, 2)))
    return np.where(np.isfinite(size), size, np.inf)
