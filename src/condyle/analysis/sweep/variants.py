"""One part of a study: its variants one after the other, each checked as a file is."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from ...errors import CondyleError, InputError, SampleError, shortened
from ...mechanism.mechanism import Mechanism
from ...model.inverse_dynamics import SOLVED
from ...model.model import Model
from ...model.model_result import ModelResult, require_ok
from ...questions.structure import Structure, structure_of
from ...results.derived import Derived
from ...results.solving import assemble
from .job import Job

OK, REFUSED, FAILED = "ok", "refused", "failed"
LONGEST_REASON = 300


class Row(NamedTuple):
    """A variant along one motion.

    measures: (measures,), NaN where the row has a reason.
    solution: a NetCDF file, where solutions are kept.
    """

    variant: int
    motion: int
    parameters: np.ndarray
    measures: np.ndarray
    status: str
    reason: str
    seconds: float
    solution: bytes | None


@dataclass(frozen=True)
class Solved:
    """A variant along one motion: what came of it, or the reason why nothing did."""

    motion: int
    model: Model | None
    evaluation: ModelResult | None
    status: str
    reason: str
    residual: float | None = None


class Solver:
    """Solves variants of a job; kernels are shared by all of one structure."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._models: dict[Structure, Model] = {}

    def variants(self, part: int) -> Iterator[tuple[int, np.ndarray, list[Solved]]]:
        """Number, values and outcomes of the variants of a part, one after the other."""
        numbers = self._job.numbers(part)
        with np.errstate(all="ignore"):
            rows = self._job.design.rows(numbers.start, numbers.stop)
            for number, row in zip(numbers, rows, strict=True):
                yield number, row, self._variant(row)

    def _variant(self, row: np.ndarray) -> list[Solved]:
        motions = range(len(self._job.motions))
        try:
            mechanism = self._job.mechanism.set(self._job.changes(row))
            model = self._model(mechanism)
        except CondyleError as error:
            return [Solved(m, None, None, REFUSED, _reason(error)) for m in motions]
        return [self._along(model, m) for m in motions]

    def _model(self, mechanism: Mechanism) -> Model:
        study = self._job.study
        structure = structure_of(mechanism, study.formulation, study.route)
        if structure not in self._models:
            self._models[structure] = self._job.model(mechanism)
        return self._models[structure].with_mechanism(mechanism)

    def _along(self, model: Model, m: int) -> Solved:
        job, motion = self._job, self._job.motions[m]
        try:
            states, residual = model.poses.of_motion(motion)
            found = model.inverse_dynamics(
                *states, job.wrenches[m], job.point, outputs=SOLVED, threads=1
            )
            require_ok(model.mechanism, found, motion.t)
        except SampleError as error:
            return Solved(m, model, found, error.kind, _reason(error), residual)
        except InputError as error:  # such as coordinates that are independent no more
            return Solved(m, model, None, REFUSED, _reason(error))
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            return Solved(m, model, None, FAILED, _reason(error))
        return Solved(m, model, found, OK, "", residual)


def solve_part(job: Job, part: int) -> list[Row]:
    """The rows of one part."""
    rows, clock = [], time.perf_counter()
    for number, values, outcomes in _solver(job).variants(part):
        for one in outcomes:
            measured = np.full(len(job.measures), np.nan)
            if one.status == OK:
                measured = _measured(job, one)
            kept = job.study.solutions and one.evaluation is not None
            solution = _netcdf(job, one) if kept else None
            seconds, clock = time.perf_counter() - clock, time.perf_counter()
            about = one.status, one.reason, seconds, solution
            rows.append(Row(number, one.motion, values, measured, *about))
    return rows


def _measured(job: Job, one: Solved) -> np.ndarray:
    assert one.model is not None
    wrench = job.wrenches[one.motion]
    derived = Derived(one.model.mechanism, one.evaluation, wrench, one.model.limited)
    return np.concatenate([reading.values(derived) for reading in job.readings])


def _netcdf(job: Job, one: Solved) -> bytes:
    """The whole solution, as a file."""
    assert one.model is not None and one.evaluation is not None
    motion, wrench = job.motions[one.motion], job.wrenches[one.motion]
    solution = assemble(
        one.model, motion, job.load, wrench, job.point, one.evaluation, one.residual, 0.0
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "solution.nc"
        solution.condyle.save(path)
        return path.read_bytes()


def _reason(error: Exception) -> str:
    """In one line."""
    text = "; ".join(getattr(error, "problems", ())) or str(error) or type(error).__name__
    return shortened(" ".join(text.split()), LONGEST_REASON)


_last: tuple[Any, Solver] | None = None


def _solver(job: Job) -> Solver:
    """The solver of the last call if it was for the same job: its kernels are loaded."""
    global _last
    if _last is None or _last[0] is not job:
        _last = job, Solver(job)
    return _last[1]
