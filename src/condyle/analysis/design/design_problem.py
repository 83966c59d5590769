"""A design study as numbers: measures of variants, and their slopes by the varied numbers."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...errors import CondyleError, InputError
from ...mechanism.mechanism import Mechanism
from ...mechanism.paths import parsed, value_at, written
from ...mechanism.table import Table
from ...model.model import Model
from ...model.variants import Variants
from ...quantities import variables
from ...questions.number_paths import FileNumbers
from ...questions.structure import walls_of
from ...results.derived import Derived
from ...results.variant_solutions import by_solution, measured
from ...status import STATUS_NAMES, Status
from ..sweep.job import Job
from ..sweep.measure import TAKES, Reading
from .design_study import DesignStudy

Array = np.ndarray
NEAR = 0.3  # of the extreme value: rows so near it count as pieces of a maximum
PIECES = 200  # of one measure at most
NONE = np.zeros(0, dtype=int)
REFUSED = 1.0  # violation of a variant that is no mechanism


@dataclass(frozen=True)
class DesignPoint:
    """A variant, evaluated.

    x:         the varied numbers, (p,).
    measures:  (K,), NaN where there is none.
    entries:   of each reading, what it reduces, (N, ...) with all motions in a row.
    violation: 0 where every sample can be solved; else how far it is from that: the least
               discriminant of the chains' assembly below 0, or 1 for what is no mechanism.
    reason:    why it cannot be solved.
    """

    x: Array
    measures: Array
    entries: tuple[Array, ...] = ()
    violation: float = 0.0
    reason: str = ""

    @property
    def good(self) -> bool:
        return not self.reason


class Term(NamedTuple):
    """A measure, by its column, times 1 where less of it is better, -1 where more is."""

    column: int
    sign: float


@dataclass(frozen=True)
class Pieces:
    """A term near a variant: the largest of some smooth functions.

    row: which entries they are, (R,);  value: (R,);  slope: (R, p).
    """

    row: Array
    value: Array
    slope: Array


class DesignProblem:
    """Measures of a job by x, (p,), with all motions together, and what they cost."""

    low: Array
    high: Array

    def __init__(self, job: Job) -> None:
        """Raises: InputError: for what has no derivative along these motions."""
        self.job = job
        assert isinstance(job.study, DesignStudy)
        self.study: DesignStudy = job.study
        self.base: np.ndarray = np.array(job.design.base)
        ends = [
            sorted(one.range or [factor * base for factor in one.scale or ()])
            for one, base in zip(self.study.vary, job.design.base, strict=True)
        ]
        self.low, self.high = np.array(ends).T
        self.evaluations: int = 0
        self.gradients: int = 0
        self.seconds: dict[str, float] = dict.fromkeys(("evaluations", "gradients"), 0.0)
        self._check()

    def _check(self) -> None:
        moved = [path for path in self.paths if path.startswith(("contact.", "platform.points"))]
        if moved and any(motion.kind == "landmark" for motion in self.job.motions):
            raise InputError(
                f"vary {moved[0]}: the motion is of a landmark, so that this number changes the "
                "pose at every time; give the motion by coordinates (condyle motion), or sweep"
            )
        self.cost: Term = Term(self.column(self.study.cost[0]), self.study.cost[1])
        away = (self.base < self.low) | (self.base > self.high)
        if away.any():
            one = self.study.vary[int(np.argmax(away))]
            raise InputError(
                f"vary {one.what}: the file's own number, {self.base[away][0]:g}, is outside its "
                "range; expected one within it"
            )

    def column(self, measure: str) -> int:
        """The column of a measure.

        Raises: InputError: if it has several.
        """
        if measure not in self.job.measures:
            raise InputError(
                f"measure {measure}: has several values, expected one; remove its over"
            )
        return self.job.measures.index(measure)

    @cached_property
    def paths(self) -> dict[str, tuple[int, float]]:
        """Path -> the varied number that it follows, and how many times."""
        columns: dict[str, tuple[int, float]] = {}
        for i, one in enumerate(self.study.vary):
            columns[one.what] = i, 1.0
            columns |= {f.what: (i, f.times) for f in one.mirror}
        return columns

    @property
    def units(self) -> dict[str, str]:
        """Units of the numbers, by path."""
        system = self.job.model.system.unreduced
        machine, structure = self.job.mechanism, system.structure
        every = FileNumbers(machine, structure, walls_of(machine, structure))
        return {one.path: one.unit for one in every.at(list(self.paths))}

    @cached_property
    def states(self) -> tuple[tuple[Array, ...], Array, dict[str, Array]]:
        """q, v and a, the wrench, and gravity and base, of all motions in a row."""
        motions = self.job.motions
        each = [self.job.model.poses.of_motion(motion)[0] for motion in motions]
        states = tuple(np.concatenate(parts) for parts in zip(*each, strict=True))
        around = [dict(motion.given) for motion in motions]
        given = {n: np.concatenate([one[n] for one in around]) for n in around[0]}
        return states, np.concatenate(self.job.wrenches), given

    # -- values ------------------------------------------------------------------------------

    def at(self, X: Array) -> list[DesignPoint]:
        """Some variants, (V, p), evaluated in one batch."""
        start = time.perf_counter()
        try:
            points = self._at(np.atleast_2d(X))
        except (CondyleError, ArithmeticError, np.linalg.LinAlgError) as error:
            if len(np.atleast_2d(X)) > 1:
                return [point for x in X for point in self.at(x[None])]
            points = [self._refused(np.ravel(X), str(error))]
        self.evaluations += len(points)
        self.seconds["evaluations"] += time.perf_counter() - start
        return points

    def _refused(self, x: Array, reason: str, violation: float = REFUSED) -> DesignPoint:
        return DesignPoint(x, np.full(len(self.job.measures), np.nan), (), violation, reason)

    def _at(self, X: Array) -> list[DesignPoint]:
        return self._points(self.job.model.variants(self.job.columns(X)), X)

    def _points(self, batch: Variants, X: Array) -> list[DesignPoint]:
        job, N = self.job, len(self.states[1])
        entries: list[list[Array]] = [[] for _ in X]
        status = np.repeat(batch.status[:, None], N, axis=1)
        for group in batch.groups:
            parts: list[list[Array]] = []
            codes = []
            for motion, wrench in zip(job.motions, job.wrenches, strict=True):
                result = group.inverse_dynamics(motion, wrench, job.point, job.outputs, 1)
                codes.append(result.status.reshape(len(group.rows), -1))
                parts.append(
                    [
                        measured(group, result, wrench, job.model.limited, _entries_of(reading))
                        for reading in job.readings
                    ]
                )
            status[group.rows] = np.concatenate(codes, axis=1)
            readings = [np.concatenate(blocks, axis=1) for blocks in zip(*parts, strict=True)]
            for v, i in enumerate(group.rows.tolist()):
                entries[i] = [reading[v] for reading in readings]
        return [
            DesignPoint(x, self._measures(own), tuple(own))
            if own and not code.any()
            else self._failed(x, batch.alone(i) if own else None, code, batch.reason(i))
            for i, (x, own, code) in enumerate(zip(X, entries, status, strict=True))
        ]

    def _measures(self, entries: Sequence[Array]) -> Array:
        parts = [
            np.ravel(TAKES[one.take](a, axis=one.axes))
            for one, a in zip(self.job.readings, entries, strict=True)
        ]
        return np.concatenate(parts)

    def _failed(self, x: Array, model: Model | None, code: Array, reason: str) -> DesignPoint:
        """How far a variant is from one that can be solved."""
        if model is None:
            return self._refused(x, reason)
        bad = np.flatnonzero(code)
        first = int(code[bad[0]])
        least = 0.0
        if first == Status.unreachable:
            reach = model.poses.survey(self.states[0][0][bad]).discriminant
            least = float(np.min(reach[np.isfinite(reach)], initial=0.0))
        share = len(bad) / len(code)
        return self._refused(
            x, f"{STATUS_NAMES[first]} in {share:.0%} of the samples", max(-least, 1e-3 * share)
        )

    # -- slopes ------------------------------------------------------------------------------

    def pieces(
        self, point: DesignPoint, terms: Sequence[Term], also: Sequence[Array]
    ) -> list[Pieces]:
        """Terms near a variant, each as the largest of smooth functions.

        Args: also: of each term, rows that are wanted besides its highest.
        """
        start = time.perf_counter()
        columns = list(self._columns(point))
        picked, wanted = [], []
        for (column, sign), more in zip(terms, also, strict=True):
            reading, values, number = columns[column]
            rows, weight = _picked(reading.take, values, sign, len(self.states[1]), more)
            picked.append((rows, weight))
            wanted.append((reading, number[rows]))
        parts = []
        for term, (rows, weight), slope in zip(
            terms, picked, self._slopes(point, wanted), strict=True
        ):
            slope = weight[:, None] * slope
            reading, values, _ = columns[term.column]
            if reading.take in ("mean", "rms"):
                value = term.sign * point.measures[[term.column]]
                parts.append(Pieces(rows[:1], value, slope.sum(axis=0)[None]))
            else:
                parts.append(Pieces(rows, weight * values[rows], slope))
        self.gradients += 1
        self.seconds["gradients"] += time.perf_counter() - start
        return parts

    def _columns(self, point: DesignPoint) -> Iterator[tuple[Reading, Array, Array]]:
        """Each measure's reading, what it reduces, time first, and where that stands."""
        for reading, entries in zip(self.job.readings, point.entries, strict=True):
            places = np.arange(entries.size).reshape(entries.shape)
            own, number = (
                np.moveaxis(a, reading.axes, range(len(reading.axes))).reshape(
                    -1, len(reading.names)
                )
                for a in (entries, places)
            )
            for k in range(len(reading.names)):
                yield reading, own[:, k], number[:, k]

    def _slopes(self, point: DesignPoint, wanted: Sequence[tuple[Reading, Array]]) -> list[Array]:
        """Derivatives of some entries by x, (R, p) for each term."""
        slopes = []
        for each in self._by(point, wanted, tuple(self.paths)):
            by_x = np.zeros((len(next(iter(each.values()))), len(self.base)))
            for path, (i, times) in self.paths.items():
                by_x[:, i] += times * each[path][:, 0]
            slopes.append(by_x)
        return slopes

    def _by(
        self, point: DesignPoint, wanted: Sequence[tuple[Reading, Array]], paths: tuple[str, ...]
    ) -> list[dict[str, Array]]:
        """Derivatives of some entries by all numbers at some paths, (R, size) each.

        Raises: InputError: where there is none.
        """
        (q, v, a), wrench, given = self.states
        model = self._model(point)
        entries = dict(
            zip((reading.names for reading in self.job.readings), point.entries, strict=True)
        )
        places = [np.unravel_index(at, entries[reading.names].shape) for reading, at in wanted]
        used = np.unique(np.concatenate([place[0] for place in places]))
        of = tuple(dict.fromkeys(reading.variable for reading, _ in wanted))
        state: dict[str, Any] = {"q": q[used]}
        if {"effort", "contact_force"} & {*of}:
            state |= {"v": v[used], "a": a[used]}
            state |= {name: values[used] for name, values in given.items()}
        if {"effort", "contact_force", "frequency"} & {*of}:
            state["wrench"] = wrench[used]
            if self.job.point is not None:
                state["at"] = np.array(model.mechanism.platform.points[self.job.point])
        d = model.derivatives(of, paths, **state, zeros=True)
        if not np.isin(d.status, (Status.ok, Status.kink)).all():
            bad = STATUS_NAMES[int(np.max(d.status))]
            raise InputError(f"{', '.join(of)}: no derivatives at some samples ({bad})")
        derivatives = []
        for (reading, _), (sample, *rest) in zip(wanted, places, strict=True):
            rows = (np.searchsorted(used, sample), *rest)
            each = {
                path: d[reading.variable, path][(slice(None), *reading.place[1:])] for path in paths
            }
            derivatives.append({path: x[rows].reshape(len(sample), -1) for path, x in each.items()})
        return derivatives

    def _model(self, point: DesignPoint) -> Model:
        return self.job.model.variants(self.job.columns(point.x[None])).alone(0)

    # -- tolerances --------------------------------------------------------------------------

    def worst(self, point: DesignPoint, path: str, error: float) -> tuple[float, float]:
        """The cost with every number of a path wrong by `error`, either way, at its worst.

        To first order, and evaluated at the errors that the first order finds.
        """
        column, sign = self.cost
        reading, values, number = list(self._columns(point))[column]
        rows, weight = _picked(reading.take, values, sign, len(self.states[1]), NONE)
        ((by,),) = (each.values() for each in self._by(point, [(reading, number[rows])], (path,)))
        slope, value = weight[:, None] * by, weight * values[rows]
        if reading.take in ("mean", "rms"):
            slope, value = slope.sum(axis=0)[None], sign * point.measures[[column]]
        high = value + error * np.abs(slope).sum(axis=1)
        model, signs = self._model(point), np.sign(slope[np.argmax(high)])
        table, start = {}, 0
        for name in _paths_of_parts(model.mechanism, path):
            here = np.array(numbers_at(model.mechanism, name), dtype=float)
            own = signs[start : start + here.size].reshape(here.shape)
            table[name], start = (here + error * own)[None], start + here.size
        self.evaluations += 1
        [moved] = self._points(model.variants(table), point.x[None])
        return sign * float(high.max()), float(moved.measures[column])


def _paths_of_parts(machine: Mechanism, path: str) -> list[str]:
    """A path of every chain or contact by its name."""
    keys = parsed(path)
    if keys[1:2] != ("*",):
        return [path]
    names = machine.chain_names if keys[0] == "chain" else machine.contact_names
    return [written((keys[0], name, *keys[2:])) for name in names]


def numbers_at(machine: Mechanism, path: str) -> Any:
    """The numbers at a path; a table as its entries in the file's order."""
    value = value_at(machine, path)
    return [*value.entries().values()] if isinstance(value, Table) else value


def _entries_of(one: Reading) -> Any:
    def read(derived: Derived, count: int) -> Array:
        found = by_solution(variables()[one.variable], derived, count)
        return found[(slice(None), *one.place)]

    return read


def _picked(take: str, a: Array, sign: float, samples: int, also: Array) -> tuple[Array, Array]:
    """Entries that a measure is made of, and their weights, times `sign`.

    Of a maximum: its peaks in time that are near the highest. Time is the first axis of `a`.
    """
    if take == "mean":
        return np.arange(len(a)), np.full(len(a), sign / len(a))
    if take == "rms":
        size = np.sqrt(np.mean(a**2))
        return np.arange(len(a)), sign * a / max(size * len(a), 1e-300)
    each = sign * np.sign(a) if take == "max_abs" else np.full(len(a), sign)
    towards = each * a
    if (sign > 0) == (take in ("max", "max_abs")):
        room = NEAR * np.ptp(towards) + 1e-12
        along = np.pad(towards.reshape(samples, -1), ((1, 1), (0, 0)), constant_values=-np.inf)
        peak = ((along[1:-1] >= along[:-2]) & (along[1:-1] >= along[2:])).ravel()
        near = np.flatnonzero(peak & (towards >= towards.max() - room))
        near = near[np.argsort(-towards[near], kind="stable")][:PIECES]
    else:  # the least of them counts
        near = np.array([np.argmin(towards)])
    near = np.union1d(near, also)
    return near, each[near]
