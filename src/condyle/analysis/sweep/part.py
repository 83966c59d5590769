"""One part of a study: its variants one after the other, each checked as a file is."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from ...errors import CondyleError, InputError, SampleError, shortened
from ...model.inverse_dynamics import SOLVED
from ...model.model import Model
from ...model.model_result import ModelResult, require_ok
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


def variants(job: Job, part: int) -> Iterator[tuple[int, np.ndarray, list[Solved]]]:
    """Number, values and outcomes of the variants of a part, one after the other."""
    numbers, motions = job.numbers(part), range(len(job.motions))
    with np.errstate(all="ignore"):
        for number, row in zip(numbers, job.design.rows(numbers.start, numbers.stop), strict=True):
            try:
                model = job.model(job.mechanism.set(job.changes(row)))
            except CondyleError as error:
                yield number, row, [Solved(m, None, None, REFUSED, _reason(error)) for m in motions]
            else:
                yield number, row, [_along(job, model, m) for m in motions]


def _along(job: Job, model: Model, m: int) -> Solved:
    motion = job.motions[m]
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
    for number, values, outcomes in variants(job, part):
        for one in outcomes:
            measured = np.full(len(job.measures), np.nan)
            if one.status == OK and one.model is not None:
                wrench = job.wrenches[one.motion]
                derived = Derived(one.model.mechanism, one.evaluation, wrench, one.model.limited)
                measured = np.concatenate([each.values(derived) for each in job.readings])
            kept = job.study.solutions and one.evaluation is not None
            solution = _netcdf(job, one) if kept else None
            seconds, clock = time.perf_counter() - clock, time.perf_counter()
            about = one.status, one.reason, seconds, solution
            rows.append(Row(number, one.motion, values, measured, *about))
    return rows


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
