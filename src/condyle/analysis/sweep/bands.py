"""Uncertainty of efforts and contact forces along a motion: quantiles over a study's variants."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from ...distribution.objectives import NAMED
from ...errors import InputError
from ...files.memory import require_memory
from ...mechanism.mechanism import Mechanism
from ...motion import Load, Motion
from ...progress import step
from ...results.solution import QUANTILE
from ...results.warnings import Notice
from ...status import Status
from ..workers import PROCESSES, check_scheduler, run_parts
from .job import Job, prepared
from .part import batches
from .study import Study

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
BANDS = ("effort", "contact_force")  # what has them
AS_SOLVED = ["formulation", "route", "load_point", "distribution", "preload", "contact_weight"]


@dataclass(frozen=True, eq=False)
class VariantResults:
    """Results of a study's variants along a motion.

    effort: (V, N, n), contact_force: (V, N, k); NaN without a result.   study: what varied.
    """

    effort: np.ndarray
    contact_force: np.ndarray
    study: dict[str, Any]

    @property
    def count(self) -> int:
        return len(self.effort)

    @property
    def failed(self) -> int:
        """Variants that have samples without a result."""
        return int(np.isnan(self.effort).any(axis=(1, 2)).sum())

    @staticmethod
    def joined(intervals: Sequence[VariantResults]) -> VariantResults:
        """Of intervals of one motion, one after the other."""
        efforts, forces = zip(*((one.effort, one.contact_force) for one in intervals), strict=True)
        return VariantResults(
            np.concatenate(efforts, axis=1), np.concatenate(forces, axis=1), intervals[0].study
        )


def with_bands(
    solution: xr.Dataset,
    study: Study,
    motion: Motion,
    load: Load,
    *,
    mechanism: Mechanism | None = None,
    workers: int | None = None,
    scheduler: str = PROCESSES,
) -> xr.Dataset:
    """The solution with quantiles of efforts and contact forces at every time.

    Only variation and sampling of the study are used; all else is as in the solution. Samples
    without a result are omitted, time by time.

    Args:   motion, load: those of the solution.
            mechanism: that of the solution; to be given where surfaces are written in Python.
            workers, scheduler: as of `condyle.sweep`.
    Raises: InputError: for a study that does not fit, or more numbers than memory holds.
    """
    check_scheduler(workers, scheduler)
    machine = mechanism or solution.condyle.mechanism
    return banded(solution, variants_of(solution, study, motion, load, machine, workers, scheduler))


def variants_of(
    solution: xr.Dataset,
    study: Study,
    motion: Motion,
    load: Load,
    machine: Mechanism,
    workers: int | None = None,
    scheduler: str = PROCESSES,
) -> VariantResults:
    """Variants of a solution, as of `with_bands`."""
    options = solution.condyle.options
    if (chosen := NAMED.get(options["distribution"])) is not None and chosen.follows:
        raise InputError(
            f"bands: distribution {options['distribution']} follows EMG, and variants of the "
            "mechanism have none: take another distribution"
        )
    own = study.model_copy(update={name: options[name] for name in AS_SOLVED})
    job = prepared(own, machine, (motion,), load)
    return VariantResults(*_all(job, workers, scheduler), own.data())


def banded(solution: xr.Dataset, variants: VariantResults) -> xr.Dataset:
    """The solution with quantiles of its variants at every time."""
    count, failed, made_of = variants.count, variants.failed, dict[str, Any]()
    for name in BANDS:
        about = {"units": solution[name].attrs["units"]}
        about["long_name"] = f"quantiles of {name} over {count} variants"
        dims = ("quantile", *solution[name].dims)
        made_of[name + QUANTILE] = dims, quantiles(getattr(variants, name)), about
    level = ("quantile", list(QUANTILES), {"units": "1", "long_name": "share of variants below"})
    made = solution.assign(made_of).assign_coords({"quantile": level})
    made.attrs["bands"] = json.dumps({"study": variants.study, "variants": count, "failed": failed})
    if failed:
        text = (
            f"{failed} of {count} variants have samples without a result; the bands are of the rest"
        )
        notices = [*made.condyle.notices, Notice("failed_variants", text, count=failed)]
        made.attrs["warnings"] = json.dumps([one.text for one in notices])
        made.attrs["notices"] = json.dumps([one.to_dict() for one in notices])
    return made


def _all(job: Job, workers: int | None, scheduler: str) -> tuple[np.ndarray, np.ndarray]:
    """Efforts (V, N, n) and contact forces (V, N, k) of all variants."""
    V, N = job.design.count, len(job.motions[0].t)
    n, k = len(job.mechanism.chains), len(job.mechanism.contacts)
    require_memory(
        16 * V * N * (n + k),  # with a copy to sort
        f"quantiles of {V} variants at {N} samples take",
        "take fewer variants, or a lower rate of the motion",
    )
    efforts, forces = np.full((V, N, n), np.nan), np.full((V, N, k), np.nan)
    with step("solving variants", V) as advance:
        for part, (effort, force) in run_parts(job, curves, range(job.parts), workers, scheduler):
            efforts[job.numbers(part)], forces[job.numbers(part)] = effort, force
            advance(len(effort))
    return efforts, forces


def curves(job: Job, part: int) -> tuple[np.ndarray, np.ndarray]:
    """Efforts and contact forces of a part's variants, NaN without a result."""
    shape = len(job.numbers(part)), len(job.motions[0].t)
    effort = np.full((*shape, len(job.mechanism.chains)), np.nan)
    force = np.full((*shape, len(job.mechanism.contacts)), np.nan)
    first = job.numbers(part).start
    for start, _, (one,) in batches(job, part):
        for group, found in one.results:
            rows, good = group.rows + (start - first), found.status == Status.ok
            for to, values in ((effort, found.effort), (force, found.contact_force)):
                values = np.where(good[:, None], values, np.nan)
                to[rows] = values.reshape(len(rows), *to.shape[1:])
    return effort, force


def quantiles(values: np.ndarray) -> np.ndarray:
    """Quantiles over the first dimension, linear between values, NaN left out, (Q, ...)."""
    ordered = np.sort(values, axis=0)  # NaN last
    last = np.isfinite(values).sum(axis=0) - 1
    found = np.empty((len(QUANTILES), *values.shape[1:]))
    for i, q in enumerate(QUANTILES):
        place = q * np.maximum(last, 0)
        below = np.floor(place).astype(int)
        above = np.minimum(below + 1, np.maximum(last, 0))
        low, high = (np.take_along_axis(ordered, at[None], axis=0)[0] for at in (below, above))
        found[i] = low + (place - below) * (high - low)
    return found
