"""Poses of joint coordinates that follow one another in time.

Each row is followed from the row before (`CONTINUATION`), the first from home. Rows
without a pose are passed over: the next is followed from the last one found.

At a singularity two assembly modes meet, and joint coordinates alone do not say in which of them a
mechanism goes on: one mode goes through, the other turns back. Rows to either side of it are well
followed one by one, into the wrong mode. But the poses so far say where the next is expected, by
their last step carried on in time. Where Newton from there finds another pose that fits, nearer to
what is expected, the track is lost: from this row on nothing is certain.

To be fast, many rows are first followed at once from one anchor. What is found so is a candidate
until every link from one row to the next is certified, by the Jacobians at its two ends where these
suffice. At the first broken link the row before becomes the anchor.
"""

from __future__ import annotations

import numpy as np

from ...kinematics.pose_finder import (
    ALIKE,
    CONVERGED,
    LONGEST,
    SHRINK,
    SHRINKING,
    NewtonStep,
    NewtonSteps,
    find,
    unlikeness,
)
from .pose_status import PoseStatus, judge

FEW = 32  # rows followed at once behind a broken link; four times as many after each success
SAME = 1e-6  # poses closer than this are one, in characteristic lengths and radians
FALLEN = 0.3  # smallest singular value of A, over that of the row before
BETTER = 0.5  # distance from what is expected, over that of the pose followed


def track(
    steps: NewtonSteps, joints: np.ndarray, time: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Poses (N, 6) and statuses (N,) of joint coordinates (N, n) at rising times (N,) [s].

    Args: tolerance: largest residual of a joint [rad or m].
    """
    count = len(joints)
    pose, status = np.zeros((count, 6)), np.full(count, PoseStatus.LOST)
    chosen = np.zeros(0, dtype=int)
    row, size = 0, count
    while row < count:
        rows = np.arange(row, min(row + size, count))
        anchor = pose[chosen[-1]] if chosen.size else np.zeros(6)
        X, reached = find(steps, np.tile(anchor, (len(rows), 1)), joints[rows])
        at = steps.step(X, joints[rows])
        verdict = judge(reached, at.residual, tolerance)
        good = verdict == PoseStatus.OK
        first = int(np.argmax(good)) if good.any() else len(rows)
        stop = first + _leading(good[first:])
        linked = first + _linked(steps, X[first:stop], at, joints[rows], first)
        # From the same anchor, rows before the first good one stay without a pose.
        taken = rows[:linked]
        pose[taken], status[taken] = X[:linked], verdict[:linked]
        new = np.concatenate([chosen[-2:], taken[first:]])
        unsure = _unsure(steps, pose[new], joints[new], time[new], tolerance)
        unsure[: len(new) - len(taken[first:])] = False
        if unsure.any():
            # The row before is the one that may have been next to the singularity.
            status[new[np.argmax(unsure) - 1] :] = PoseStatus.LOST
            break
        chosen = new
        row += linked
        size = 4 * size if linked == len(rows) else FEW
    return pose, status


def _linked(
    steps: NewtonSteps, pose: np.ndarray, at: NewtonStep, joints: np.ndarray, first: int
) -> int:
    """How many poses from the first on are each followed from the one before.

    Args: at, joints: of more rows, of which `pose` are those from `first` on.
    """
    run = slice(first + 1, first + len(pose))
    before, after, given = pose[:-1], pose[1:], joints[run]
    if not len(after):
        return len(pose)
    move, way = steps.step(before, given).move, steps.between(before, after)
    size = steps.size(move)
    linked = steps.size(move - way) <= SHRINK * size + CONVERGED
    linked &= (size <= LONGEST) & (unlikeness(at.A[first : run.stop - 1], at.A[run]) <= ALIKE)
    doubtful = np.flatnonzero(~linked)
    end, reached = find(steps, before[doubtful], given[doubtful])
    linked[doubtful] = reached & (steps.size(steps.between(end, after[doubtful])) <= SAME)
    return 1 + _leading(linked)


def _unsure(
    steps: NewtonSteps, pose: np.ndarray, joints: np.ndarray, time: np.ndarray, tolerance: float
) -> np.ndarray:
    """Where another pose fits and is nearer to what the two poses before let expect, (N,)."""
    unsure = np.zeros(len(pose), dtype=bool)
    if len(pose) < 3:
        return unsure
    ratio = np.diff(time)[1:] / np.diff(time)[:-1]
    here, given = pose[2:], joints[2:]
    expected = pose[1:-1] + steps.between(pose[:-2], pose[1:-1]) * ratio[:, None]
    off = steps.size(steps.between(expected, here))
    other, fits = find(steps, expected, given, SHRINKING)
    residual = steps.step(other, given).residual
    fits &= judge(fits, residual, tolerance) == PoseStatus.OK
    fits &= steps.size(steps.between(here, other)) > SAME
    another = fits & (steps.size(steps.between(expected, other)) < BETTER * off)
    # Next to a singularity, A changes altogether within less than what is expected is off by.
    A = steps.step(pose[1:], joints[1:]).A
    step = steps.size(steps.between(pose[1:-1], here))
    at_border = unlikeness(A[:-1], A[1:]) * off > step
    sigma = np.linalg.svd(A[:-1][at_border], compute_uv=False)[:, -1]
    fallen = np.linalg.svd(A[1:][at_border], compute_uv=False)[:, -1]
    at_border[at_border] = fallen < FALLEN * sigma
    unsure[2:] = another | at_border
    return unsure


def _leading(good: np.ndarray) -> int:
    """How many are true from the first on."""
    return len(good) if good.all() else int(np.argmin(good))
