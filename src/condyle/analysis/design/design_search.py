"""The search: sequential quadratic programs on pieces, inside a region that is trusted.

Near a variant each measure is the largest of some smooth functions; of these and their slopes a
quadratic program makes a step, which is taken if the cost, with a penalty on limits, falls as it
promised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...extras import require
from .design_problem import DesignPoint, DesignProblem, Term

Array = np.ndarray
PENALTY, HARDEST = 10.0, 1e7  # of what exceeds a limit, beside a cost of 1; what it is raised to
FIRST, SMALLEST = 0.5, 1e-7  # the region, in half ranges
TAKEN, GOOD = 0.05, 0.5  # shares of the promise
KEPT = 1e-6  # of a limit's size: no more than that is exceeded
NEARLY = 1e-4  # of a limit's size or of half a range: so near an end it holds a number
DAMPED = 0.2  # Powell's share of the curvature that is kept


@dataclass(frozen=True)
class Rule:
    """A limit: a term, its bound, in units of `size`, and words for it."""

    term: Term
    bound: float
    size: float
    words: str

    def over(self, point: DesignPoint) -> float:
        """How far it is exceeded; negative where it is kept."""
        return float(self.term.sign * point.measures[self.term.column] - self.bound) / self.size


@dataclass(frozen=True)
class SearchResult:
    """Where a search ended.

    feasible: whether all limits are kept;  steps: how many were taken;
    binding:  what holds it, in words.
    """

    point: DesignPoint
    feasible: bool
    steps: int
    binding: tuple[str, ...]


@dataclass(frozen=True)
class _Lines:
    """Linear pieces at a variant, of the cost first.

    term: which of cost and rules, (R,);  row: (R,);  value: (R,), relative to bound and size;
    slope: (R, p), by x in half ranges.
    """

    term: Array
    row: Array
    value: Array
    slope: Array


def search(
    problem: DesignProblem, start: DesignPoint, cost: Term, rules: Sequence[Rule]
) -> SearchResult:
    """The best variant near a start that can be solved."""
    require("clarabel", "identify")
    half = (problem.high - problem.low) / 2
    size = max(abs(float(start.measures[cost.column])), 1e-12)
    aims = [Rule(cost, 0.0, size, "cost"), *rules]

    def over(point: DesignPoint) -> float:
        return max([rule.over(point) for rule in rules], default=0.0)

    def merit(point: DesignPoint) -> float:
        return aims[0].over(point) + penalty * max(0.0, over(point))

    def lines(point: DesignPoint, held: _Lines | None = None) -> _Lines:
        also = [
            np.zeros(0, dtype=int) if held is None else held.row[held.term == i]
            for i in range(len(aims))
        ]
        pieces = problem.pieces(point, [aim.term for aim in aims], also)
        parts = [
            (np.full(len(p.row), i), p.row, p.value - aim.bound, p.slope * half)
            for i, (aim, p) in enumerate(zip(aims, pieces, strict=True))
        ]
        term, row, value, slope = (np.concatenate(blocks) for blocks in zip(*parts, strict=True))
        size = np.array([aim.size for aim in aims])[term]
        return _Lines(term, row, value / size, slope / size[:, None])

    here, radius, penalty, steps = start, FIRST, PENALTY, 0
    B, local = np.zeros((len(half), len(half))), lines(start)
    for _ in range(problem.study.options.steps):
        low, high = (problem.low - here.x) / half, (problem.high - here.x) / half
        step, promise, force = _program(
            local, B, np.fmax(low, -radius), np.fmin(high, radius), penalty
        )
        now = merit(here)
        if radius < SMALLEST or now - promise < problem.study.options.accuracy * abs(now):
            if over(here) <= KEPT or penalty >= HARDEST:
                break
            penalty, radius = 10 * penalty, FIRST
            continue
        [there] = problem.at(here.x + half * step)
        gain = (now - merit(there)) / (now - promise) if there.good else -1.0
        if gain < TAKEN:
            radius = np.abs(step).max() / 3
            continue
        if gain > GOOD and np.abs(step).max() > 0.9 * radius:
            radius *= 2
        felt = force > 1e-9
        held = _Lines(*(part[felt] for part in (local.term, local.row, local.value, local.slope)))
        new = lines(there, held)
        at = {key: i for i, key in enumerate(zip(new.term, new.row, strict=True))}
        same = [at[key] for key in zip(held.term, held.row, strict=True)]
        B = _bent(B, step, force[felt] @ (new.slope[same] - held.slope))
        here, local, steps = there, new, steps + 1
    words = [rule.words for rule in rules if rule.over(here) > -NEARLY]
    low, high = (problem.low - here.x) / half, (problem.high - here.x) / half
    for number, down, up in zip(problem.study.vary, -low, high, strict=True):
        if min(down, up) < NEARLY:
            words.append(f"{number.what} at its {'lower' if down < up else 'upper'} end")
    return SearchResult(here, over(here) <= KEPT, steps, tuple(words))


def _program(
    lines: _Lines, B: Array, low: Array, high: Array, penalty: float
) -> tuple[Array, float, Array]:
    """The step d, (p,), the merit that it promises, and how hard each line presses, (R,).

    Least s + penalty t + d'B d / 2 with every line of the cost below s, of rules below t >= 0.
    """
    import clarabel
    from scipy import sparse

    p, R = len(low), len(lines.value)
    of_cost = lines.term == 0
    A = np.zeros((R + 1 + 2 * p, p + 2))
    A[:R, :p], A[:R, p], A[:R, p + 1] = lines.slope, -1.0 * of_cost, of_cost - 1.0
    A[R, p + 1] = -1.0
    A[R + 1 : R + 1 + p, :p], A[R + 1 + p :, :p] = np.eye(p), -np.eye(p)
    b = np.concatenate([-lines.value, [0.0], high, -low])
    P = np.zeros((p + 2, p + 2))
    P[:p, :p] = B
    c = np.concatenate([np.zeros(p), [1.0, penalty]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(P)),
        c,
        sparse.csc_matrix(A),
        b,
        [clarabel.NonnegativeConeT(len(b))],
        settings,
    )
    solution = solver.solve()
    d = np.clip(np.array(solution.x[:p]), low, high)
    if not np.isfinite(d).all():
        raise InputError(f"the search's quadratic program has no answer ({solution.status})")
    value = lines.value + lines.slope @ d
    over = max(0.0, float(np.max(value[~of_cost], initial=0.0)))
    promise = float(value[of_cost].max()) + penalty * over + float(d @ B @ d) / 2
    return d, promise, np.array(solution.z[:R])


def _bent(B: Array, step: Array, y: Array) -> Array:
    """B with what slopes changed by along a step, y: Broyden, Fletcher, Goldfarb and Shanno's,
    damped by Powell's rule so that B stays positive definite."""
    if not B.any():
        B = np.eye(len(step)) * max(abs(float(y @ step)) / float(step @ step), 1e-8)
    Bs = B @ step
    bent, drawn = float(step @ Bs), float(step @ y)
    if drawn < DAMPED * bent:
        share = (1 - DAMPED) * bent / (bent - drawn)
        y = share * y + (1 - share) * Bs
        drawn = float(step @ y)
    return B - np.outer(Bs, Bs) / bent + np.outer(y, y) / drawn
