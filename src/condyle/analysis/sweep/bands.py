"""Uncertainty of efforts and contacts along a motion: quantiles over a study's variants."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from ...distribution.objectives import NAMED
from ...errors import InputError
from ...files.memory import require_memory
from ...mechanism.mechanism import Mechanism
from ...motion import Load, Motion
from ...progress import step
from ...quantities import Quantity, variables
from ...results.solution import QUANTILE
from ...results.variant_solutions import by_solution, measured, outputs_of
from ...results.warnings import Notice
from ...status import Status
from ..workers import PROCESSES, check_scheduler, run_parts
from .job import Job, prepared
from .part import batches
from .study import Study

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
BANDS = (  # what has them, as far as a solution has it
    "effort", "contact_force",
    "indentation", "contact_area", "mean_pressure", "peak_pressure", "energy_density",
)  # fmt: skip
AS_SOLVED = ["formulation", "route", "load_point", "distribution", "preload", "contact_weight"]


@dataclass(frozen=True, eq=False)
class VariantResults:
    """Results of a study's variants along a motion.

    values: of each quantity that has bands (V, N, entries), NaN without a result;
    study: what varied;  session: what varied of a session besides, its [bands].
    """

    values: Mapping[str, np.ndarray]
    study: dict[str, Any]
    session: dict[str, Any] = field(default_factory=dict)

    @staticmethod
    def alone(solution: xr.Dataset) -> VariantResults:
        """A solution as its only variant."""
        good = solution["status"].values == Status.ok
        known = {
            name: np.where(good[:, None], solution[name].values, np.nan)[None]
            for name in BANDS
            if name in solution
        }
        return VariantResults(known, {})

    @property
    def count(self) -> int:
        return len(self.values["effort"])

    @property
    def failed(self) -> int:
        """VariantResults that have samples without a result."""
        return int(np.isnan(self.values["effort"]).any(axis=(1, 2)).sum())

    @property
    def about(self) -> dict[str, Any]:
        """What solutions say of their bands."""
        told = {"study": self.study, "variants": self.count, "failed": self.failed}
        return told | ({"session": self.session} if self.session else {})

    @staticmethod
    def joined(intervals: Sequence[VariantResults]) -> VariantResults:
        """Results of intervals of one motion, one after the other."""
        values = {
            name: np.concatenate([one.values[name] for one in intervals], axis=1)
            for name in intervals[0].values
        }
        return VariantResults(values, intervals[0].study)


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
    """The solution with quantiles of efforts, contact forces and, where contacts have compliance,
    their indentation, area and pressures at every time.

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
    """VariantResults of a solution, as of `with_bands`."""
    options = solution.condyle.options
    if (chosen := NAMED.get(options["distribution"])) is not None and chosen.follows:
        raise InputError(
            f"bands: distribution {options['distribution']} follows EMG, and variants of the "
            "mechanism have none: take another distribution"
        )
    update = {name: options[name] for name in AS_SOLVED}
    update["contacts"] = options.get("contacts", "kept")  # which older files have not
    own = study.model_copy(update=update)
    job = prepared(own, machine, (motion,), load)
    rows = [row for row in variables().values() if row.name in BANDS and row.name in solution]
    reads = (partial(by_solution, row) for row in rows)
    job = replace(job, outputs=outputs_of(job.model, reads, motion.given))
    return VariantResults(_all(job, rows, workers, scheduler), own.data())


def banded(solution: xr.Dataset, variants: VariantResults) -> xr.Dataset:
    """The solution with quantiles of its variants at every time."""
    count, failed, made_of = variants.count, variants.failed, dict[str, Any]()
    for name, values in variants.values.items():
        about = {"units": solution[name].attrs["units"]}
        about["long_name"] = f"quantiles of {name} over {count} variants"
        dims = ("quantile", *solution[name].dims)
        made_of[name + QUANTILE] = dims, quantiles(values), about
    level = ("quantile", list(QUANTILES), {"units": "1", "long_name": "share of variants below"})
    made = solution.assign(made_of).assign_coords({"quantile": level})
    made.attrs["bands"] = json.dumps(variants.about)
    if failed:
        text = (
            f"{failed} of {count} variants have samples without a result; the bands are of the rest"
        )
        notices = [*made.condyle.notices, Notice("failed_variants", text, count=failed)]
        made.attrs["warnings"] = json.dumps([one.text for one in notices])
        made.attrs["notices"] = json.dumps([one.to_dict() for one in notices])
    return made


def _all(
    job: Job, rows: Sequence[Quantity], workers: int | None, scheduler: str
) -> dict[str, np.ndarray]:
    """Quantities of all variants, (V, N, entries) each."""
    V, N = job.design.count, len(job.motions[0].t)
    sizes = {row.name: math.prod(row.shape(job.mechanism)) for row in rows}
    require_memory(
        16 * V * N * sum(sizes.values()),  # with a copy to sort
        f"quantiles of {V} variants at {N} samples take",
        "take fewer variants, or a lower rate of the motion",
    )
    values = {name: np.full((V, N, size), np.nan) for name, size in sizes.items()}
    take = partial(curves, names=tuple(sizes))
    with step("solving variants", V) as advance:
        for part, solved in run_parts(job, take, range(job.parts), workers, scheduler):
            for name, own in solved.items():
                values[name][job.numbers(part)] = own
            advance(len(job.numbers(part)))
    return values


def curves(job: Job, part: int, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Quantities of a part's variants, NaN without a result."""
    count, N = len(job.numbers(part)), len(job.motions[0].t)
    rows = {name: variables()[name] for name in names}
    values = {
        name: np.full((count, N, *row.shape(job.mechanism)), np.nan) for name, row in rows.items()
    }
    first = job.numbers(part).start
    for start, _, (outcome,) in batches(job, part):
        for group, result in outcome.results:
            at = group.rows + (start - first)
            good = (result.status == Status.ok).reshape(len(at), N, 1)
            for name, row in rows.items():
                about = job.wrenches[0], job.model.limited, partial(by_solution, row)
                values[name][at] = np.where(good, measured(group, result, *about), np.nan)
    return values


def quantiles(values: np.ndarray) -> np.ndarray:
    """Quantiles over the first dimension, linear between values, NaN left out, (Q, ...)."""
    ordered = np.sort(values, axis=0)  # NaN last
    last = np.isfinite(values).sum(axis=0) - 1
    levels = np.empty((len(QUANTILES), *values.shape[1:]))
    for i, q in enumerate(QUANTILES):
        place = q * np.maximum(last, 0)
        below = np.floor(place).astype(int)
        above = np.minimum(below + 1, np.maximum(last, 0))
        low, high = (np.take_along_axis(ordered, at[None], axis=0)[0] for at in (below, above))
        levels[i] = low + (place - below) * (high - low)
    return levels
