"""Efforts and contact forces of N samples: the public function of this room."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from .certificate import excess, residual
from .explain import explain
from .law import Square
from .newton import Answer, point, step
from .objective import Objective, named
from .problem import Problem
from .reduced import Reduced, reduce
from .result import Result, Status

ENTRIES = 24_000  # efforts worked on at once: what fits into a processor's cache
SINGULAR = 1e-12  # ratio of singular values of A below which efforts are not determined
DOUBTFUL = 1e-6  # pivot of A A^T below which that ratio is looked at
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
    rows = np.flatnonzero(finite)
    size = max(64, ENTRIES // max(problem.n, 1))
    for start in range(0, len(rows), size):
        block = rows[start : start + size]
        _block(problem.take(block), objective, signs, result, block)
    return result


def patterns(problem: Problem) -> np.ndarray:
    """All signs of the contacts that have friction in any sample, 0 for others, (P, k)."""
    rubs = (problem.frictions != 0).any(axis=(0, 2))
    choices = [(1, -1) if rubbing else (0,) for rubbing in rubs]
    return np.array(list(product(*choices)), dtype=int).reshape(-1, problem.k)


def _block(
    problem: Problem, objective: Objective, signs: np.ndarray, result: Result, rows: np.ndarray
) -> None:
    """Solve some samples and write them into the rows of `result`.

    Friction turns with the sign sigma of the contact force, so the equations are linear only
    once the signs are given. A pattern of signs is consistent where sigma_k lambda_k >= 0, a
    constraint of its program; the answer is the least of all patterns.
    """
    count = problem.count
    scale, weight = objective.scale(problem), objective.weight(problem)
    programs, starts = [], []
    bounds = np.empty((len(signs), count))
    singular = np.zeros(count, dtype=bool)
    for p, sign in enumerate(signs):
        pattern = np.broadcast_to(sign, (count, problem.k))
        r = reduce(problem, pattern, scale, weight, objective.limits)
        u, bad = _unlimited(r)
        singular |= bad
        programs.append(r)
        starts.append(u)
        bounds[p] = objective.lower_bound(r, u)
    best = Answer.empty(programs[0])
    chosen = np.full(count, -1)
    values = np.full((2, count), np.inf)
    unknown = np.zeros((len(signs), count), dtype=bool)  # neither an answer nor a proof of none
    order = np.argsort(bounds, axis=0, kind="stable")
    for rank, p in product(range(len(signs)), range(len(signs))):
        bound = bounds[p] - TIE * np.abs(bounds[p])
        todo = np.flatnonzero((order[rank] == p) & (bound < values[0]) & ~singular)
        if not len(todo):
            continue
        r = programs[p].take(todo)
        answer = objective.solve(r, starts[p][:, todo], values[0, todo])
        value = np.full((2, len(todo)), np.inf)
        found = objective.values(r, answer)
        value[: len(found)] = np.where(answer.found, found, np.inf)
        value[len(found) :] = np.where(answer.found, 0.0, np.inf)
        less = _less(value, values[:, todo])
        best.put(todo[less], answer.take(less))
        chosen[todo[less]] = p
        values[:, todo[less]] = value[:, less]
        unknown[p, todo] = ~answer.found & ~answer.beaten
    _write(programs, best, chosen, signs, result, rows)
    for row in rows[singular]:
        result.refuse(int(row), Status.singular, np.nan)
    # What has no answer has none for a reason, which is found one sample at a time.
    for i in np.flatnonzero(~singular & (unknown.any(axis=0) | (chosen < 0))):
        single = [r.take(np.array([i])) for r in programs]
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


def _unlimited(r: Reduced) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers of the least squares without limits, (6, R); which samples are singular."""
    n, k = r.low.shape[0], r.k
    free = replace(
        r,
        low=np.full_like(r.low, -np.inf),
        high=np.full_like(r.high, np.inf),
        contact_low=np.full((k, r.count), -np.inf),
        contact_high=np.full((k, r.count), np.inf),
    )
    zero = np.zeros((6, r.count))
    change, quality = step(free, Square(), point(free, Square(), zero))
    singular = ~r.regular
    doubtful = np.flatnonzero(r.regular & ~(quality > DOUBTFUL))
    if n < r.m:
        singular |= True
    elif len(doubtful) and r.m:
        A = r.G[: r.m, :, doubtful].transpose(2, 0, 1)
        sizes = np.linalg.norm(A, axis=2, keepdims=True)
        sigma = np.linalg.svd(A / np.where(sizes > 0, sizes, 1.0), compute_uv=False)
        singular[doubtful] = ~(sigma[:, -1] > SINGULAR * sigma[:, 0])
    return change, singular


def _write(
    programs: list[Reduced],
    best: Answer,
    chosen: np.ndarray,
    signs: np.ndarray,
    result: Result,
    rows: np.ndarray,
) -> None:
    """Answers of some samples, with their certificates, into the result."""
    for p, r in enumerate(programs):
        here = np.flatnonzero(chosen == p)
        if not len(here):
            continue
        part, answer, to = r.take(here), best.take(here), rows[here]
        result.effort[to] = answer.x.T * r.scale
        result.contact_force[to] = answer.force.T
        result.pattern[to] = signs[p]
        result.residual[to] = residual(part, answer)
        result.primal[to] = excess(part, answer)
        result.dual[to] = answer.error
        result.status[to] = Status.ok
        result.shortfall[to] = 1.0
