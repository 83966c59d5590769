"""`design`: the numbers of a file that make a motion cheapest, within limits."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...files.atomic import make_folder, write_text
from ...identification.fitted_file import write_fitted
from ...mechanism.mechanism import Mechanism
from ...mechanism.writing import dumps
from ...motion import Load, Motion, as_load, as_motion
from ...motion.table_writer import write_table
from ...progress import step
from ...results.study_answer import StudyAnswer, named_lines
from ..sweep.job import DEFAULT, prepared
from .design_problem import DesignPoint, DesignProblem, Term
from .design_search import Rule, SearchResult, search
from .design_study import DesignStudy

BISECTIONS = 12  # towards the file's numbers, until a start can be solved
UNMET = 1e-9  # violation that counts as none
RESTORING = 400  # evaluations, where the file's own mechanism cannot be solved


@dataclass(frozen=True, eq=False)
class Designed(StudyAnswer):
    """A better mechanism, and how it was found.

    mechanism: with the best numbers;  best, first: of the search, and the file's own;
    ends: where the search from each start ended;  front: of `pareto`;
    tolerance: path -> [cost, to first order; cost, evaluated] with its errors at their worst.
    """

    kind = "design"
    mechanism: Mechanism
    first: DesignPoint
    best: SearchResult
    ends: tuple[SearchResult, ...]
    front: tuple[SearchResult, ...]
    tolerance: dict[str, tuple[float, float]]
    problem: DesignProblem
    source: Mechanism | str | os.PathLike[str]

    @property
    def gradient_cost(self) -> float:
        """What the slopes of a variant took, in evaluations of one variant."""
        p = self.problem
        one = p.seconds["evaluations"] / max(p.evaluations, 1)
        return p.seconds["gradients"] / max(p.gradients, 1) / one

    @property
    def table(self) -> dict[str, list[Any]]:
        """The file's own numbers, then where each search ended: numbers and measures."""
        return self._rows([self.first, *(one.point for one in self.ends)])

    @property
    def front_table(self) -> dict[str, list[Any]]:
        """The Pareto front, one point a row."""
        return self._rows([one.point for one in self.front])

    @property
    def tables(self) -> dict[str, dict[str, list[Any]]]:
        front = {"Pareto front": self.front_table} if self.front else {}
        return {"The file's own numbers, then the end of each search": self.table, **front}

    def _rows(self, points: list[DesignPoint]) -> dict[str, list[Any]]:
        job = self.problem.job
        numbers = zip(job.parameters, np.array([p.x for p in points]).T.tolist(), strict=True)
        found = zip(job.measures, np.array([p.measures for p in points]).T.tolist(), strict=True)
        return dict([*numbers, *found])

    @property
    def data(self) -> dict[str, Any]:
        p, best = self.problem, self.best.point
        return {
            "numbers": dict(zip(p.job.parameters, best.x.tolist(), strict=True)),
            "before": dict(zip(p.job.measures, self.first.measures.tolist(), strict=True)),
            "after": dict(zip(p.job.measures, best.measures.tolist(), strict=True)),
            "limits_kept": self.best.feasible,
            "binding": list(self.best.binding),
            "starts": [
                {"cost": float(one.point.measures[p.cost.column]), "limits_kept": one.feasible}
                for one in self.ends
            ],
            "front": self.front_table if self.front else {},
            "tolerance": {
                path: {"first_order": a, "evaluated": b} for path, (a, b) in self.tolerance.items()
            },
            "evaluations": p.evaluations,
            "gradients": p.gradients,
            "evaluations_a_gradient": self.gradient_cost,
        }

    def __str__(self) -> str:
        p = self.problem
        units = [unit for one in p.job.readings for unit in [one.units] * len(one.names)]
        rows = zip(
            p.job.measures, self.first.measures, self.best.point.measures, units, strict=True
        )
        lines = named_lines({name: f"{a:10.5g} -> {b:10.5g} {unit}" for name, a, b, unit in rows})
        if not self.best.feasible:
            lines.append("Not all limits are kept: no start led to numbers that keep them")
        lines.append(f"held by: {', '.join(self.best.binding) or 'nothing'}")
        moved = zip(p.job.parameters, p.base, self.best.point.x, strict=True)
        lines += named_lines({name: f"{a:10.6g} -> {b:10.6g}" for name, a, b in moved})
        for path, (line, real) in self.tolerance.items():
            lines.append(
                f"{path} +- {p.study.tolerance[path]:g}: {p.study.cost[0]} {real:.5g} at the worst "
                f"({line:.5g} to first order)"
            )
        lines.append(
            f"{p.evaluations} evaluations and {p.gradients} gradients, each as long as "
            f"{self.gradient_cost:.1f} evaluations; {len(self.ends)} starts"
        )
        return "\n".join(lines)

    def save(self, out: str | os.PathLike[str]) -> list[Path]:
        """Write a folder: the mechanism's file, starts.csv, and front.csv of a Pareto front."""
        folder, p = Path(out), self.problem
        make_folder(folder)
        files = [folder / f"{self.mechanism.name}.toml", folder / "starts.csv"]
        if any(path.startswith("contact.") for path in p.paths):  # surfaces may follow
            write_text(files[0], dumps(self.mechanism))
        else:
            cost = self.best.point.measures[p.cost.column]
            header = f"designed: {p.study.cost[0]} {cost:.6g}"
            write_fitted(self.source, self.mechanism, p.units, files[0], header)
        write_table(files[1], self.table)
        if self.front:
            files.append(folder / "front.csv")
            write_table(files[-1], self.front_table)
        return files


def design(
    study: DesignStudy | str | os.PathLike[str] | Mapping[str, Any],
    *,
    mechanism: Mechanism | str | os.PathLike[str] | None = None,
    motion: Motion | None = None,
    load: Load | None = None,
) -> Designed:
    """The numbers of a mechanism's file that make a motion cheapest, within limits.

    Sequential quadratic programs with exact slopes, from the file's own numbers and the rows of
    the study's sampling; each ends in a local best, of which the best is taken.

    Args:   study: a design study (TOML), or its tables.
            mechanism, motion, load: instead of those that the study names.
    Raises: InputError: for a study that does not fit, and where no numbers can be solved.
            MissingExtraError: without the extra "identify".
    """
    spec = DesignStudy.read(study)
    motions = None if motion is None else (as_motion(motion),)
    with step("checking the study"):
        acting = None if load is None else as_load(load)
        problem = DesignProblem(prepared(spec, mechanism, motions, acting))
    first = problem.at(problem.base)[0]
    own = first if first.good else _restored(problem, first)
    rules = [
        rule for name, limit in spec.limits.items() for rule in _rules(problem, name, limit, own)
    ]
    ends = []
    sampled = problem.job.design.rows(0, problem.job.design.count)
    with step("searching", 1 + len(sampled)) as advance:
        ends.append(search(problem, own, problem.cost, rules))
        advance(1)
        for x in sampled:
            ends.append(search(problem, _reached(problem, x, own), problem.cost, rules))
            advance(1)
    best = _best(problem, ends)
    front = _front(problem, best, rules) if spec.pareto else ()
    batch = problem.job.model.variants(problem.job.columns(best.point.x[None]))
    source = mechanism if mechanism is not None else spec.mechanism or DEFAULT
    worst = {p: problem.worst(best.point, p, error) for p, error in spec.tolerance.items()}
    made = batch.mechanism(0)
    return Designed(made, first, best, tuple(ends), front, worst, problem, source)


def _best(problem: DesignProblem, ends: list[SearchResult]) -> SearchResult:
    """The best end: those that keep the limits first, then by cost."""
    column, sign = problem.cost
    return min(ends, key=lambda one: (not one.feasible, sign * float(one.point.measures[column])))


def _rules(problem: DesignProblem, name: str, limit: Any, own: DesignPoint) -> list[Rule]:
    rules = []
    for column, measure in enumerate(problem.job.measures):
        if measure.partition(".")[0] != name:
            continue
        for bound, sign, words in ((limit.least, -1.0, "least"), (limit.most, 1.0, "most")):
            if bound is not None:
                size = max(abs(bound), abs(float(own.measures[column])), 1e-12)
                rules.append(
                    Rule(Term(column, sign), sign * bound, size, f"{measure} at {words} {bound:g}")
                )
    return rules


def _reached(problem: DesignProblem, x: np.ndarray, own: DesignPoint) -> DesignPoint:
    """A start, drawn towards numbers that can be solved until it can be."""
    for _ in range(BISECTIONS):
        [point] = problem.at(x)
        if point.good:
            return point
        x = (x + own.x) / 2
    return own


def _restored(problem: DesignProblem, first: DesignPoint) -> DesignPoint:
    """Numbers that can be solved, nearest to the file's by the violation's fall.

    Raises: InputError: where none are found.
    """
    from scipy.optimize import minimize

    half = (problem.high - problem.low) / 2
    points = [first]

    def violation(z: np.ndarray) -> float:
        points.append(problem.at(problem.base + half * z)[0])
        return points[-1].violation

    low, high = (problem.low - problem.base) / half, (problem.high - problem.base) / half
    minimize(  # type: ignore[call-overload]  # arrays are what it takes
        violation,
        np.zeros(len(half)),
        method="COBYQA",
        bounds=np.column_stack([low, high]),
        options={"maxfev": RESTORING, "f_target": UNMET},
    )
    least = min(points, key=lambda point: point.violation)
    if not least.good:
        raise InputError(
            "no numbers within their ranges let this mechanism make the motion: the file's own "
            f"fail ({first.reason}), and the nearest still ({least.reason}; violation "
            f"{least.violation:.3g}). Widen the ranges, or draw the motion in"
        )
    return least


def _front(
    problem: DesignProblem, best: SearchResult, rules: list[Rule]
) -> tuple[SearchResult, ...]:
    """The best cost for each of several values of another measure: the epsilon-constraint way.

    From the best cost to the best of the other measure, each from the point before it, and back.
    """
    pareto = problem.study.pareto
    assert pareto is not None
    column = problem.column(pareto.measure)
    sign = -1.0 if problem.study.measure[pareto.measure].better == "more" else 1.0
    term = Term(column, sign)
    other = search(problem, best.point, term, rules)
    a, b = (float(sign * result.point.measures[column]) for result in (best, other))
    size = max(abs(a), abs(b), 1e-12)
    bounds = np.linspace(a, b, pareto.count)[1:]
    front = [best, *(other for _ in bounds)]
    there = list(range(1, len(front)))
    with step("following the front", 2 * len(there)) as advance:
        for i, way in [*((i, 1) for i in there), *((i, -1) for i in reversed(there))]:
            bound = float(bounds[i - 1])
            rule = Rule(term, bound, size, f"{pareto.measure} at {sign * bound:g}")
            start = front[i - 1] if way > 0 else front[min(i + 1, len(there))]
            found = search(problem, start.point, problem.cost, [*rules, rule])
            front[i] = found if way > 0 else _best(problem, [front[i], found])
            advance(1)
    return tuple(front)
