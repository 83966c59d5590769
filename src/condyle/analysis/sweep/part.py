"""One part of a study: its variants together, each checked as a file is."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import xarray as xr

from ...errors import InputError, ProblemsError, SampleError, shortened
from ...model.model_result import ModelResult
from ...model.variants import VariantGroup, Variants
from ...results.derived import Derived
from ...results.variant_solutions import measured
from ...status import STATUS_NAMES, Status
from .job import MOTION, REASON, SECONDS, STATUS, VARIANT, Job

OK, REFUSED, FAILED = "ok", "refused", "failed"
LONGEST_REASON = 300
TOGETHER = 2**15  # samples of a batch: what they take stays small


class PartRows(NamedTuple):
    """A row for each variant and motion, in the order of the study.

    table: measures are NaN where the row has a reason.
    solutions: by variant and motion a NetCDF file, where solutions are kept.
    """

    table: pa.Table
    solutions: dict[tuple[int, int], bytes]


@dataclass
class MotionOutcome:
    """Some variants along one motion.

    results: results of those alike, flat, sample by sample of one variant after the other.
    status: of each variant, or the kind of its first failed sample, with its reason.
    """

    motion: int
    results: list[tuple[VariantGroup, ModelResult]]
    status: list[str]
    reason: list[str]


def batches(job: Job, part: int) -> Iterator[tuple[int, np.ndarray, list[MotionOutcome]]]:
    """Number of the first variant, values, and what came of them along each motion, of some
    variants after the others."""
    numbers = job.numbers(part)
    size = max(1, TOGETHER // max(len(motion.t) for motion in job.motions))
    with np.errstate(all="ignore"):
        for start in range(numbers.start, numbers.stop, size):
            yield from _batch(job, start, min(start + size, numbers.stop))


def _batch(
    job: Job, start: int, stop: int
) -> Iterator[tuple[int, np.ndarray, list[MotionOutcome]]]:
    """Variants start to stop; those with which numbers fail by themselves."""
    values = job.design.rows(start, stop)
    problem: Exception
    try:
        batch = job.model.variants(job.columns(values))
        outcomes = [_on_motion(job, batch, m) for m in range(len(job.motions))]
    except InputError as error:
        problem, kind = error, REFUSED
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        problem, kind = error, FAILED
    else:
        yield start, values, outcomes
        return
    if stop - start > 1:
        middle = (start + stop) // 2
        yield from _batch(job, start, middle)
        yield from _batch(job, middle, stop)
    else:
        why = [kind], [_reason(problem)]
        yield start, values, [MotionOutcome(m, [], *why) for m in range(len(job.motions))]


def _on_motion(job: Job, batch: Variants, m: int) -> MotionOutcome:
    motion, wrench = job.motions[m], job.wrenches[m]
    status, reason = [OK] * len(batch), [""] * len(batch)
    for i in np.flatnonzero(batch.status).tolist():
        status[i], reason[i] = STATUS_NAMES[batch.status[i]], _in_line(batch.reason(i))
    results = []
    for group in batch.groups:
        given = motion, wrench, job.point, job.outputs, 1, job.study.contacts
        answer = group.inverse_dynamics(*given)
        results.append((group, answer))
        failed = answer.status.reshape(len(group.rows), -1).any(axis=1)
        for i in group.rows[failed].tolist():
            status[i], reason[i] = _failure(job, batch, i, m)
    return MotionOutcome(m, results, status, reason)


def _failure(job: Job, batch: Variants, i: int, m: int) -> tuple[str, str]:
    try:
        _alone(job, batch, i, m)
    except SampleError as error:
        return error.kind, _reason(error)
    raise AssertionError("a sample failed among others only")


def _alone(job: Job, batch: Variants, i: int, m: int, flag: bool = False) -> xr.Dataset:
    """The solution of one variant along a motion."""
    how: Any = {"load_point": job.point, "flag": flag, "contacts": job.study.contacts}
    return batch.alone(i).solve(job.motions[m], job.load, threads=1, **how)


def solve_part(job: Job, part: int) -> PartRows:
    """The rows of one part."""
    tables, solutions = zip(*(_rows(job, *one) for one in batches(job, part)), strict=True)
    return PartRows(
        pa.concat_tables(tables), {k: file for one in solutions for k, file in one.items()}
    )


def _rows(job: Job, start: int, values: np.ndarray, outcomes: list[MotionOutcome]) -> PartRows:
    clock = time.perf_counter()
    V, M = len(values), len(outcomes)
    measures = np.full((V, M, len(job.measures)), np.nan)
    solutions: dict[tuple[int, int], bytes] = {}

    def read(derived: Derived, count: int) -> np.ndarray:
        return np.concatenate([entry.values(derived, count) for entry in job.readings], axis=1)

    for run in outcomes:
        for group, result in run.results:
            rows = group.rows
            good = (result.status == Status.ok).reshape(len(rows), -1).all(axis=1)
            about = job.wrenches[run.motion], job.model.limited
            measures[rows[good], run.motion] = measured(group, result, *about, read)[good]
            if job.study.solutions:
                for i in rows.tolist():
                    solutions[start + i, run.motion] = _netcdf(job, group.variants, i, run.motion)
    columns: dict[str, Any] = {VARIANT: np.repeat(np.arange(start, start + V), M)}
    if M > 1:
        columns[MOTION] = [motion.source for motion in job.motions] * V
    columns |= zip(job.parameters, np.repeat(values, M, axis=0).T, strict=True)
    columns |= zip(job.measures, measures.reshape(V * M, -1).T, strict=True)
    columns[STATUS] = np.transpose([run.status for run in outcomes]).ravel().tolist()
    columns[REASON] = np.transpose([run.reason for run in outcomes]).ravel().tolist()
    columns[SECONDS] = np.full(V * M, (time.perf_counter() - clock) / (V * M))
    return PartRows(pa.table(columns), solutions)


def _netcdf(job: Job, batch: Variants, i: int, m: int) -> bytes:
    """The whole solution, as a file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "solution.nc"
        _alone(job, batch, i, m, flag=True).condyle.save(path)
        return path.read_bytes()


def _reason(error: Exception) -> str:
    """The reason of an error in one line."""
    problems = error.problems if isinstance(error, ProblemsError) else ()
    return _in_line("; ".join(problems) or str(error) or type(error).__name__)


def _in_line(text: str) -> str:
    return shortened(" ".join(text.split()), LONGEST_REASON)
