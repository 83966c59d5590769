"""Efforts and contact forces of N samples: the public function of this room."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from .explain import explain
from .law import Square
from .newton import Answer, point, step
from .objective import Objective, named
from .problem import Problem
from .reduced import Reduced, orthonormal, reduce
from .result import Result, Status
from .small import pick

ENTRIES = 48_000  # efforts worked on at once: many enough for calls to cost little
SINGULAR = 1e-12  # ratio of singular values of A below which efforts are not determined
DOUBTFUL = 1e-6  # pivot of A A^T below which that ratio is looked at
BOUND = 1e-9  # of a lower bound, by which rounding may have put it too high
TIE = 1e-12  # of a value: patterns of friction nearer than this are equal, and the first counts


def distribute(problem: Problem, distribution: str = "bounded") -> Result:
    """Share every sample's force among efforts and contacts.

        least objective(effort)  with  Q = J^T (effort - offset) + sum_k lambda_k D_k

    Args:    distribution: name of an objective, see `OBJECTIVES`.
    Returns: efforts, contact forces, a status a sample, and a certificate.
    Raises:  InputError: if the objective has no meaning with these limits.
    """
    objective = named(distribution)
    objective.check(problem)
    result = Result.empty(problem.count, problem.n, problem.k)
    signs = patterns(problem)
    finite = problem.finite
    result.status[~finite] = Status.unreachable
    if problem.n < 6 - problem.k:  # fewer efforts than equations
        result.status[finite] = Status.singular
        return result
    rows = np.flatnonzero(finite)
    size = max(64, ENTRIES // (max(problem.n, 1) * len(signs)))
    for start in range(0, len(rows), size):
        block = rows[start : start + size]
        part = problem if len(block) == problem.count else problem.take(block)
        _block(part, objective, signs, result, block)
    return result


def patterns(problem: Problem) -> np.ndarray:
    """All signs of the contacts that have friction in any sample, 0 for others, (P, k)."""
    rubs = (problem.frictions != 0).any(axis=(0, 2))
    choices = [(1, -1) if rubbing else (0,) for rubbing in rubs]
    found = list(product(*choices))
    return np.array(found, dtype=int).reshape(len(found), problem.k)


def _block(
    problem: Problem, objective: Objective, signs: np.ndarray, result: Result, rows: np.ndarray
) -> None:
    """Solve some samples and write them into the rows of `result`.

    Friction turns with the sign sigma of the contact force, so the equations are linear only
    once the signs are given. A pattern of signs is consistent where sigma_k lambda_k >= 0, a
    constraint of its program; the answer is the least of all patterns. Here a sample stands once
    under every pattern, pattern after pattern.
    """
    count, choices = problem.count, len(signs)
    programs = reduce(
        problem.take(np.tile(np.arange(count), choices)) if choices > 1 else problem,
        np.repeat(signs, count, axis=0),
        objective.scale(problem),
        objective.weight(problem),
        objective.limits,
    )
    programs, start, singular = _prepare(programs)
    singular = np.any(singular.reshape(choices, count), axis=0)
    bounds = objective.lower_bound(programs, start).reshape(choices, count)
    bounds = bounds - BOUND * np.abs(np.where(np.isfinite(bounds), bounds, 0.0))
    order = np.argsort(bounds, axis=0, kind="stable")

    best = Answer.empty(problem.n, problem.k, count)
    chosen = np.full(count, -1)
    values = np.full((2, count), np.inf)
    unknown = np.zeros((choices, count), dtype=bool)  # neither an answer nor a proof of none
    for p in order:  # the most promising pattern of every sample, then the next
        todo = np.flatnonzero((bounds[p, np.arange(count)] < values[0]) & ~singular)
        if not len(todo):
            continue
        at = p[todo] * count + todo
        part = programs if len(at) == programs.count else programs.take(at)
        answer = objective.solve(part, pick(start, at), values[0, todo])
        value = np.zeros((2, len(todo)))
        found = objective.values(part, answer)
        value[: len(found)] = found
        value[:, ~answer.found] = np.inf
        less = _less(value, values[:, todo])
        best.put(todo[less], answer.take(less))
        chosen[todo[less]] = p[todo[less]]
        values[:, todo[less]] = value[:, less]
        unknown[p[todo], todo] = ~answer.found & ~answer.beaten
    answered = np.flatnonzero(chosen >= 0)
    to, answer = rows[answered], best.take(answered)
    result.effort[to] = answer.x.T * programs.scale
    result.contact_force[to] = answer.force.T
    result.pattern[to] = signs[chosen[answered]]
    result.residual[to], result.primal[to] = answer.residual, answer.excess
    result.dual[to] = answer.error
    result.status[to], result.shortfall[to] = Status.ok, 1.0
    for row in rows[singular]:
        result.refuse(int(row), Status.singular, np.nan)
    # What has no answer has none for a reason, which is found one sample at a time.
    for i in np.flatnonzero(~singular & (unknown.any(axis=0) | (chosen < 0))):
        single = [programs.take(np.array([p * count + i])) for p in range(choices)]
        status, shortfall = explain(single, signs, unknown[:, i], bool(chosen[i] >= 0))
        if status != Status.ok:
            result.refuse(int(rows[i]), status, shortfall)


def _less(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Whether values a, (levels, R), come before b: level by level, equal within `TIE`."""
    with np.errstate(invalid="ignore"):
        near = TIE * np.maximum(np.abs(a), np.abs(b))
        first = a[0] < b[0] - np.where(np.isfinite(near[0]), near[0], 0.0)
        equal = np.isfinite(a[0]) & np.isfinite(b[0]) & (np.abs(a[0] - b[0]) <= near[0])
        second = a[1] < b[1] - np.where(np.isfinite(near[1]), near[1], 0.0)
    return first | (equal & second)


def _prepare(r: Reduced) -> tuple[Reduced, np.ndarray, np.ndarray]:
    """Well-conditioned equations, multipliers of the least squares without limits, (6, R), and
    which samples are singular, (R,)."""
    start, quality = _unlimited(r)
    singular = ~r.regular
    doubtful = np.flatnonzero(r.regular & ~(quality > DOUBTFUL))
    if len(doubtful):
        sigma = np.linalg.svd(r.equations(doubtful), compute_uv=False)
        none = ~(sigma[:, -1] > SINGULAR * sigma[:, 0])
        singular[doubtful] = none
        hard = doubtful[~none]
        r = orthonormal(r, hard)
        start[:, hard] = _unlimited(r.take(hard))[0]
    return r, start, singular


def _unlimited(r: Reduced) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers of the least squares without limits, (6, R), and their least pivots, (R,)."""
    free = replace(
        r,
        low=np.full_like(r.low, -np.inf),
        high=np.full_like(r.high, np.inf),
        contact_low=np.full((r.k, r.count), -np.inf),
        contact_high=np.full((r.k, r.count), np.inf),
    )
    return step(free, Square(), point(free, Square(), np.zeros((6, r.count))))
