"""Muscle recruitment: sum (effort_i / max_i)^3 over efforts that only pull."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import InputError
from .certificate import settle
from .law import Cube
from .newton import Answer, greatest, maximise
from .objective import Objective, register
from .problem import Problem
from .quadratic import least_squares
from .reduced import Reduced, typical
from .small import pick, total

# f = x^3 / 3 has no curvature at 0, where the answer to a price is steepest; a very small
# square added to it keeps Newton's steps finite and changes less than the certificate shows.
SOFT = 1e-12
STEPS = 20
PRIMAL_SOFT, PRIMAL_STEPS = 1e-5, 40  # of the quadratic programs where that does not end
NEAR = 1e-9  # of a limit: an effort this near a bound is at it
ENDED = 1e-13  # of the greatest effort: a step that ends them


class Cubic(Objective):
    name = "cubic"
    summary = "sum of cubes of efforts over their limits, efforts >= 0: muscle recruitment"
    mixes_units = True

    def check(self, problem: Problem) -> None:
        super().check(problem)
        if (problem.limits[0] < 0).any():
            negative = np.flatnonzero(problem.limits[0] < 0).tolist()
            raise InputError(
                f"cubic is for efforts that only pull; efforts {negative} may be negative. Set "
                "their lower limit to 0, or use weighted"
            )

    def solve(self, r: Reduced, start: np.ndarray, cutoff: np.ndarray) -> Answer:
        size = typical(r)
        law = Cube(SOFT * size)
        cutoff = np.minimum(cutoff, greatest(r, law))
        answer = settle(r, Cube(), maximise(r, law, start * size, cutoff, STEPS))
        left = np.flatnonzero(~answer.found & ~answer.beaten)
        if len(left):
            found = _by_squares(r.take(left), pick(start, left))
            part, law = r.take(left), law.take(left)
            exact = maximise(part, law, np.nan_to_num(found.u), cutoff[left], STEPS)
            exact = settle(part, Cube(), exact)
            found = settle(part, Cube(), found)
            found.put(np.flatnonzero(exact.found), exact.take(exact.found))
            found.beaten |= exact.beaten & ~found.found
            answer.put(left, found)
        return answer

    def values(self, r: Reduced, answer: Answer) -> np.ndarray:
        return total(answer.x**3, 0)[None] / 3.0


def _by_squares(r: Reduced, start: np.ndarray) -> Answer:
    """Newton's method on the efforts themselves: a quadratic program a step, within all bounds.

    f near x is (2 x + soft) (z - target)^2 / 2 with target = x - x^2 / (2 x + soft).
    """
    never = np.full(r.count, np.inf)
    now = least_squares(r, start, never)
    answer = Answer.empty(r.n, r.k, r.count)
    rows = np.flatnonzero(now.found)
    r, x, u = r.take(rows), pick(now.x, rows), pick(now.u, rows)
    never, moving = never[rows], np.ones(len(rows), dtype=bool)
    for _ in range(PRIMAL_STEPS):
        curvature = 2 * x + PRIMAL_SOFT * x.max(axis=0, initial=0.0) + np.finfo(float).tiny
        target, root = x - x * x / curvature, np.sqrt(curvature)
        G = r.G / root
        model = replace(
            r,
            G=G,
            right=r.right - total(r.G * target, 1),
            low=root * (r.low - target),
            high=root * (r.high - target),
        )
        found = least_squares(model, u, never)
        step = np.where(found.found, target + found.x / root - x, 0.0)
        # f' is rising along the step: bisect where it vanishes, if that is before its end.
        low, high = np.zeros(r.count), np.ones(r.count)
        rises = total((x + step) ** 2 * step, 0) > 0
        for _ in range(30):
            middle = 0.5 * (low + high)
            above = total((x + middle * step) ** 2 * step, 0) > 0
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        x = np.where(moving, np.maximum(x + np.where(rises, low, 1.0) * step, r.low), x)
        u = np.where(moving & found.found, found.u, u)
        moving &= found.found & (np.abs(step).max(axis=0) > ENDED * x.max(axis=0))
        if not moving.any():
            break
    for i in range(r.count):
        x[:, i], u[:, i] = _polished(r, i, x[:, i], u[:, i])
    answer.put(rows, Answer.of(x, r.forces(x), u, found=True))
    return answer


def _polished(r: Reduced, i: int, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x and multipliers u of one sample to all digits, from those that are nearly right.

    Newton's method on both at once, with the bounds that are met held as equations: near the
    limit of what is possible multipliers grow, and x does not follow from them alone.
    """
    G, right, m = r.G[:, :, i], r.right[:, i].copy(), r.m
    x, u = x.copy(), u.copy()
    free = (x > r.low[:, i] + NEAR) & (x < r.high[:, i] - NEAR)
    bound = np.where(u[m:] < 0, r.contact_low[:, i], r.contact_high[:, i])
    acts = (u[m:] != 0) & np.isfinite(bound)
    right[m:] -= np.where(acts, bound, 0.0)
    rows = np.concatenate([np.ones(m, dtype=bool), acts])
    part, count = G[np.ix_(rows, free)], int(free.sum())
    for _ in range(4):
        K = np.block([
            [np.diag(2 * x[free]), -part.T],
            [part, np.zeros((len(part), len(part)))],
        ])  # fmt: skip
        wrong = np.concatenate([part.T @ u[rows] - x[free] ** 2, right[rows] - G[rows] @ x])
        change = np.linalg.lstsq(K, wrong)[0]
        x[free] += change[:count]
        u[rows] += change[count:]
    return x, u


register(Cubic())
