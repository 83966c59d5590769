"""Uncertainty of efforts and contacts along a motion: quantiles over a study's variants."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
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
from .part import OK, batches
from .study import Study

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
BANDED = (
    "effort", "contact_force",
    "indentation", "contact_area", "mean_pressure", "peak_pressure", "energy_density",
)  # fmt: skip
AS_SOLVED = ["formulation", "route", "load_point", "distribution", "preload", "contact_weight"]


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
    machine, options = mechanism or solution.condyle.mechanism, solution.condyle.options
    if (chosen := NAMED.get(options["distribution"])) is not None and chosen.follows:
        raise InputError(
            f"bands: distribution {options['distribution']} follows EMG, and variants of the "
            "mechanism have none: take another distribution"
        )
    own = study.model_copy(update={name: options[name] for name in AS_SOLVED})
    job = prepared(own, machine, (motion,), load)
    banded = [one for one in variables().values() if one.name in BANDED and one.name in solution]
    reads = (partial(by_solution, one) for one in banded)
    job = replace(job, outputs=outputs_of(job.model, reads, motion.given))
    found, failed = _all(job, banded, workers, scheduler)
    count, made_of = job.design.count, dict[str, Any]()
    for one in banded:
        about = {"units": solution[one.name].attrs["units"]}
        about["long_name"] = f"quantiles of {one.name} over {count} variants"
        dims = ("quantile", *solution[one.name].dims)
        made_of[one.name + QUANTILE] = dims, _quantiles(found[one.name]), about
    level = ("quantile", list(QUANTILES), {"units": "1", "long_name": "share of variants below"})
    made = solution.assign(made_of).assign_coords({"quantile": level})
    made.attrs["bands"] = json.dumps({"study": own.data(), "variants": count, "failed": failed})
    if failed:
        text = (
            f"{failed} of {count} variants have samples without a result; the bands are of the rest"
        )
        notices = [*made.condyle.notices, Notice("failed_variants", text, count=failed)]
        made.attrs["warnings"] = json.dumps([one.text for one in notices])
        made.attrs["notices"] = json.dumps([one.to_dict() for one in notices])
    return made


def _all(
    job: Job, banded: Sequence[Quantity], workers: int | None, scheduler: str
) -> tuple[dict[str, np.ndarray], int]:
    """Quantities of all variants, (V, N, entries) each, and how many variants failed."""
    V, N = job.design.count, len(job.motions[0].t)
    sizes = {one.name: math.prod(one.shape(job.mechanism)) for one in banded}
    require_memory(
        16 * V * N * sum(sizes.values()),  # with a copy to sort
        f"quantiles of {V} variants at {N} samples take",
        "take fewer variants, or a lower rate of the motion",
    )
    found = {name: np.full((V, N, size), np.nan) for name, size in sizes.items()}
    failed, take = 0, partial(curves, banded=tuple(sizes))
    with step("solving variants", V) as advance:
        for part, (values, bad) in run_parts(job, take, range(job.parts), workers, scheduler):
            for name, own in values.items():
                found[name][job.numbers(part)] = own
            failed += bad
            advance(len(job.numbers(part)))
    return found, failed


def curves(job: Job, part: int, banded: Sequence[str]) -> tuple[dict[str, np.ndarray], int]:
    """Quantities of a part's variants, NaN without a result, and who failed."""
    count, N = len(job.numbers(part)), len(job.motions[0].t)
    rows = {name: variables()[name] for name in banded}
    found = {
        name: np.full((count, N, *one.shape(job.mechanism)), np.nan) for name, one in rows.items()
    }
    failed, first = 0, job.numbers(part).start
    for start, _, (outcome,) in batches(job, part):
        failed += sum(status != OK for status in outcome.status)
        for group, result in outcome.results:
            at = group.rows + (start - first)
            good = (result.status == Status.ok).reshape(len(at), N, 1)
            for name, one in rows.items():
                about = job.wrenches[0], job.model.limited, partial(by_solution, one)
                found[name][at] = np.where(good, measured(group, result, *about), np.nan)
    return found, failed


def _quantiles(values: np.ndarray) -> np.ndarray:
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
