"""Efforts and contact forces of N samples: the public function of this room.

The question `allocation` solves nearly all samples at the speed of its backend. Samples that it
cannot prove are solved by DAQP, one at a time, which also classifies the infeasible ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations, product
from typing import Any

import numpy as np

from ..backends.c.compiled_kernel import CompiledKernel
from ..backends.choose import Backend, BackendName
from ..backends.compiler import CompilerError
from ..backends.kernel import OK, Kernel
from ..backends.numpy_kernel import NumpyKernel
from ..graph.program import Numbers
from ..questions import Question
from ..questions.allocation import TIE, TURNS, CostTerm, cost_term
from ..questions.levelled import CHANGES
from ..questions.numbers import Layout
from ..questions.structure import Structure
from .certificate import Optimum
from .eliminated import Sample
from .objectives import LEVEL, Objective, named
from .problem import Problem
from .result import CERTIFIED, Outcome, Result
from .stretch import least_stretch

WORTH_A_KERNEL = 200  # samples that are worth a kernel of their own
TRIAL = 32  # samples that show, of many, which kernel is worth its time


def distribute(
    problem: Problem, distribution: str = "bounded", backend: Backend | BackendName | None = "numpy"
) -> Result:
    """Distribute the generalized force of every sample over efforts and contact forces.

        min objective(effort)  subject to  Q = J^T (effort - offset) + sum_k lambda_k D_k

    Args:    distribution: name of an objective, see `OBJECTIVES`.
             backend: backend of the question, or its name; None: the robust solver alone.
    Returns: efforts, contact forces, status and certificate of every sample.
    Raises:  InputError: if the objective is undefined for these limits.
    """
    objective = named(distribution)
    objective.check(problem)
    if problem.target is not None:
        return _towards(problem, problem.target, distribution, backend)
    result = Result.empty(problem.count, problem.n, problem.k)
    signs = patterns(problem)
    left = np.arange(problem.count)
    determined = problem.n >= 6 - problem.k
    # Of patterns whose maxima are equal the sums of squares decide, which the kernels leave out.
    kernels = objective.term is not None and not (objective.peaks and len(signs) > 1)
    if kernels and backend is not None and left.size and determined:
        chosen = Backend(backend) if isinstance(backend, str) else backend
        left = _by_kernel(problem, objective, signs, result, chosen)
    finite = problem.finite
    for i in left:
        if not finite[i] or not determined:
            result.status[i] = Outcome.singular if finite[i] else Outcome.unreachable
        else:
            _alone(problem, int(i), objective, signs, result)
    return result


def _towards(
    problem: Problem, target: np.ndarray, distribution: str, backend: Backend | BackendName | None
) -> Result:
    """The distribution of efforts measured from a target."""
    result = distribute(problem.untargeted(), distribution, backend)
    result.effort[...] += target
    held = np.flatnonzero(result.status == Outcome.infeasible)
    if held.size:  # limits are stretched about 0
        bare = replace(problem.take(held), target=None)
        result.shortfall[held] = distribute(bare, distribution, backend).shortfall
    return result


def within(problem: Problem, effort: np.ndarray, contact_force: np.ndarray) -> np.ndarray:
    """Samples that respect effort limits and the preload of contacts, (N,).

    Minimum-norm efforts that do are those of `bounded` too; only the others are distributed.
    Friction signs are ignored.

    Args: effort: (N, n).   contact_force: (N, k) [N].
    """
    kept = ((effort >= problem.low) & (effort <= problem.high)).all(axis=1)
    pushing = contact_force * problem.push >= problem.preload
    kept &= (pushing | (problem.push == 0)).all(axis=1)
    return kept & ((np.abs(contact_force) >= problem.preload) | ~problem.rubs).all(axis=1)


def patterns(problem: Problem) -> np.ndarray:
    """All sign patterns of the contacts with friction, 0 for others, (P, k)."""
    rubs = problem.rubs if problem.preload else (problem.friction != 0).any(axis=(0, 2))
    found = list(product(*[(1, -1) if rubbing else (0,) for rubbing in rubs]))
    return np.array(found, dtype=float).reshape(len(found), problem.k)


# -- by the question -----------------------------------------------------------------------


@lru_cache(maxsize=16)
def _kernel(n: int, k: int, term: Any, weighs: bool, backend: str, careful: bool = False) -> Kernel:
    """One kernel for every mechanism with n efforts and k contacts."""
    structure = Structure("virtual_power", "core", (("cable", n),), (("plane", 4),) * k, ())
    layout = Layout.of(structure)
    shared, (lane,) = layout.sizes
    lanes, padding = np.ones((1, lane, n)), np.zeros((1, lane))
    numbers = Numbers(np.zeros((1, shared)), (lanes,), (padding,), tuple(range(n)))
    question = (
        Question.about(structure, "levelled")
        if term == LEVEL
        else Question.about(structure, "allocation", term, weighs, careful)
    )
    if backend == "compiled":
        try:
            return CompiledKernel(question.key, question.variants, numbers)
        except CompilerError:  # the model's own kernels give notice of it
            pass
    return NumpyKernel(question.variants(), numbers)


def _by_kernel(
    p: Problem, objective: Objective, signs: np.ndarray, result: Result, backend: Backend
) -> np.ndarray:
    """Fill in the samples that the question proves; returns the others."""
    assert objective.term is not None
    bounds, count, k = objective.ports(p), p.count, p.k
    own = p.n, k, objective.term, "weight" in bounds, backend.name
    inputs = {name: np.broadcast_to(a, (count, a.shape[-1])) for name, a in bounds.items()}
    moved = np.einsum("rni,rn->ri", p.J, p.offset) if p.offset.any() else 0.0
    inputs |= {"Q": p.Q + moved, "J": p.J.transpose(0, 2, 1)}
    # Entry by entry, so that columns are not copied.
    for name, a in (("normal", p.normal), ("friction", p.friction)):
        inputs[name] = np.moveaxis(np.moveaxis(a, 0, -1).reshape(6 * k, count), -1, 0)
    solved, known = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    best = np.full(count, np.inf)
    for sigma in signs:
        inputs["sigma"] = np.broadcast_to(sigma, (count, k))
        good, values = _levelled(own, inputs) if objective.peaks else _solved(own, inputs)
        known &= good | (values["none"] == 1)
        with np.errstate(invalid="ignore"):
            less = good & ~(values["value"] >= best - TIE * np.where(solved, np.abs(best), 0.0))
        solved |= good
        best = np.where(less, values["value"], best)
        result.effort[less] = values["effort"].T[less]
        result.contact_force[less] = values["contact_force"].T[less]
        result.residual[less], result.pattern[less] = values["residual"][less], sigma
    good = solved & known
    result.status[good], result.shortfall[good] = Outcome.ok, 1.0
    result.primal[good] = result.dual[good] = 0.0  # by construction
    return np.flatnonzero(~good)


def _solved(
    own: tuple[int, int, Any, bool, str], inputs: dict[str, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Which samples are proved by the usual kernel or the careful one, and all results.

    Args: own: what kernels are made of, see `_kernel`.
    """
    count = len(inputs["Q"])
    if count >= 10 * WORTH_A_KERNEL:
        some = np.linspace(0, count - 1, TRIAL).astype(int)
        tried = {name: a[some] for name, a in inputs.items()}
        if _unsettled(*_proved(_kernel(*own), tried, cost_term(own[2]))).size > TRIAL / 2:
            return _proved(_kernel(*own, careful=True), inputs, cost_term(own[2]).careful())
    good, values = _proved(_kernel(*own), inputs, cost_term(own[2]))
    rows = _unsettled(good, values)
    if len(rows) >= WORTH_A_KERNEL:
        hard = {name: a[rows] for name, a in inputs.items()}
        kernel = _kernel(*own, careful=True)
        good[rows], better = _proved(kernel, hard, cost_term(own[2]).careful())
        for name, a in better.items():
            values[name][..., rows] = a
    return good, values


def _levelled(
    own: tuple[int, int, Any, bool, str], inputs: dict[str, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """As `_solved`: from the least squares the path to the least maximum."""
    good, values = _solved((*own[:2], "square", *own[3:]), inputs)
    rows, kernel = np.flatnonzero(good), _kernel(*own)
    effort, force = values["effort"].T[rows], values["contact_force"].T[rows]
    path = {
        "side": _side(effort, inputs["low"][rows], inputs["high"][rows]),
        "contact_side": _side(force, inputs["contact_low"][rows], inputs["contact_high"][rows]),
        "level": np.abs(effort / inputs["scale"][rows]).max(axis=1, keepdims=True),
    }
    good[...] = False
    for _ in range(-(-2 * own[0] // CHANGES)):
        if not rows.size:
            break
        answer = kernel.run({name: a[rows] for name, a in inputs.items()} | path)
        good[rows] = answer.status == OK
        for name in ("effort", "contact_force", "value", "residual"):
            values[name][..., rows] = answer.values[name]
        going = answer.values["ended"] == 0
        rows = rows[going]
        path = {name: np.atleast_2d(answer.values[name])[:, going].T for name in path}
    return good, values


def _side(a: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """1 at the greatest, -1 at the least, to rounding, else 0."""
    near = 1e-14 * np.abs(a)
    return (a >= high - near).astype(float) - (a <= low + near)


def _unsettled(good: np.ndarray, values: dict[str, np.ndarray]) -> np.ndarray:
    """Samples that are neither proved nor infeasible."""
    return np.flatnonzero(~good & (values["none"] != 1))


def _proved(
    kernel: Kernel, inputs: dict[str, np.ndarray], term: CostTerm
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Which samples are proved, and all results; the others continue up to the term's steps."""
    count = len(inputs["Q"])
    multipliers, begun = np.broadcast_to(0.0, (count, 6)), np.broadcast_to(0.0, (count, 1))
    answer = kernel.run(inputs | {"multipliers": multipliers, "begun": begun})
    good, values, rows = answer.status == OK, answer.values, np.arange(count)
    for _ in range(TURNS, term.turns, TURNS):
        going = ~good[rows] & (values["none"][rows] != 1)
        if not going.any():
            break
        if not going.all():
            rows, inputs = rows[going], {name: a[going] for name, a in inputs.items()}
        started = {"multipliers": values["multipliers"].T[rows], "begun": np.ones((len(rows), 1))}
        answer = kernel.run(inputs | started)
        good[rows] = answer.status == OK
        for name, a in answer.values.items():
            values[name][..., rows] = a
    return good, values


# -- one sample after the other ------------------------------------------------------------


def _alone(p: Problem, i: int, objective: Objective, signs: np.ndarray, result: Result) -> None:
    """Solve one sample for every sign pattern; write the best answer, or why there is none."""
    scale, weight = objective.scale(p), objective.weight(p)
    samples = [Sample.of(p, i, sigma, scale, weight, objective.limits) for sigma in signs]
    programs = [s for s in samples if s is not None]
    if len(programs) < len(samples):
        if len(signs) > 1 or weight or not _dependent(p, i, objective, result):
            result.refuse(i, Outcome.singular, np.nan)
        return
    best: tuple[tuple[float, ...], int, Optimum] | None = None
    unknown = np.zeros(len(signs), dtype=bool)
    for at, s in enumerate(programs):
        answer = objective.solve(s)
        unknown[at] = answer is None
        if answer is not None:
            values = objective.values(s, answer)
            if best is None or _before(values, best[0]):
                best = values, at, answer
    status, shortfall = _explained(programs, signs, unknown, best is not None)
    if best is None or status != Outcome.ok:
        result.refuse(i, status, shortfall)
        return
    _, at, answer = best
    unit, measure = programs[at].unit, programs[at].measure
    result.effort[i] = unit * answer.x * scale
    result.contact_force[i] = unit * measure * answer.force
    result.pattern[i], result.status[i], result.shortfall[i] = signs[at], status, 1.0
    result.residual[i], result.primal[i], result.dual[i] = (
        answer.residual,
        answer.excess,
        answer.slack,
    )


def _dependent(p: Problem, i: int, objective: Objective, result: Result) -> bool:
    """Solve a sample whose unilateral contacts depend on each other, as a block's on four corners.

    Whatever contacts bear together, some that do not depend on each other bear too: so the efforts
    are the best of all such sets. Forces of all contacts are then those of least norm.
    """
    sided, scale = np.flatnonzero(p.push), objective.scale(p)
    bilateral = np.flatnonzero(p.push == 0).tolist()
    best: tuple[tuple[float, ...], np.ndarray] | None = None
    for some in _subsets(sided.tolist()):
        own = sorted([*bilateral, *some])
        if len(own) == p.k or p.n < 6 - len(own):
            continue
        part = p.bearing(own)
        s = Sample.of(part, i, np.zeros(len(own)), scale, 0.0, objective.limits)
        answer = None if s is None else objective.solve(s)
        if s is None or answer is None:
            continue
        values = objective.values(s, answer)
        if best is None or _before(values, best[0]):
            best = values, s.unit * answer.x * scale
    if best is None:
        return False
    effort, force, D = best[1], np.full(p.k, np.inf), p.normal[i].T
    borne = p.Q[i] - p.J[i].T @ (effort - p.offset[i])
    for some in _subsets(sided.tolist()):
        own = sorted([*bilateral, *some])
        candidate = np.zeros(p.k)
        candidate[own] = np.linalg.pinv(D[:, own]) @ borne
        left = np.abs(borne - D @ candidate).max()
        pushes = (candidate * p.push >= -CERTIFIED * np.abs(candidate).max(initial=0.0)).all()
        if left <= CERTIFIED * np.abs(borne).max() and pushes:
            force = min(force, candidate, key=np.linalg.norm)
    if not np.isfinite(force).all():
        return False
    result.effort[i], result.contact_force[i], result.pattern[i] = effort, force, 0
    result.status[i], result.shortfall[i] = Outcome.indeterminate, 1.0
    left = np.abs(borne - D @ force).max()
    result.residual[i] = left / max(np.abs(effort).max(initial=0.0), np.abs(force).max(initial=0.0))
    return True


def _subsets(of: list[int]) -> list[tuple[int, ...]]:
    return [some for size in range(len(of) + 1) for some in combinations(of, size)]


def _before(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether a precedes b lexicographically; entries within `TIE` are equal."""
    for one, other in zip(a, b, strict=True):
        if abs(one - other) > TIE * max(abs(one), abs(other)):
            return one < other
    return False


def _explained(
    programs: Sequence[Sample], signs: np.ndarray, unknown: np.ndarray, answered: bool
) -> tuple[Outcome, float]:
    """Status and shortfall of a sample.

    Args: unknown: sign patterns without an answer, (P,);  answered: whether another has one, which
          is the minimum if the unknown ones are infeasible.
    """
    if not unknown.any():
        return Outcome.ok, 1.0
    needed = np.array([_needed(s) if u else 0.0 for s, u in zip(programs, unknown, strict=True)])
    # Nearer to 1 the feasible set is a point to rounding: a solver that finds none may be right.
    if (unknown & (needed < 1 - CERTIFIED)).any():
        return Outcome.uncertified, np.nan
    if answered:
        return Outcome.ok, 1.0
    shortfall = float(needed.min())
    if not np.isfinite(shortfall) and signs.any():
        bare = [_signs_only(s, sigma) for s, sigma in zip(programs, signs, strict=True)]
        if not any(np.isfinite(_needed(s)) for s in bare):
            return Outcome.jammed, np.nan
    return Outcome.infeasible, shortfall


def _needed(s: Sample) -> float:
    """The smallest feasible factor on the limits of a sample, inf if there is none."""
    if s.contradictory:
        return np.inf
    none = np.full_like(s.low, np.inf)
    return least_stretch(replace(s, low=-none, high=none), s.low, s.high).t


def _signs_only(s: Sample, sigma: np.ndarray) -> Sample:
    """Without effort limits and unilateral contacts."""
    none = np.full_like(s.low, np.inf)
    return replace(
        s,
        low=-none,
        high=none,
        contact_low=np.where(sigma > 0, 0.0, -np.inf),
        contact_high=np.where(sigma < 0, 0.0, np.inf),
    )
