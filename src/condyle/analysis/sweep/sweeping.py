"""A sweep: a study is checked, solved in parts by any scheduler, and read back in its order."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import xarray as xr

from ...errors import InputError
from ...mechanism.mechanism import Mechanism
from ...motion import Load, Motion, as_load, as_motion
from ...motion.arrays import as_number
from ...progress import step
from ..workers import PROCESSES, check_scheduler, run_parts
from .job import SECONDS, prepared
from .part import solve_part
from .share import Share
from .study import Study
from .study_folder import Store, open_sweep


def sweep(
    study: Study | str | os.PathLike[str] | Mapping[str, Any],
    out: str | os.PathLike[str] | None = None,
    *,
    workers: int | None = None,
    scheduler: str = PROCESSES,
    resume: bool = False,
    part: str | None = None,
    minutes: float | None = None,
    mechanism: Mechanism | str | os.PathLike[str] | None = None,
    motion: Motion | None = None,
    load: Load | None = None,
) -> xr.Dataset:
    """Solve every variant of a study; one row each, along `row`, in the order of the study.

    Columns: variant, motion (if there are several), the parameters by their paths, the measures,
    status, reason, seconds. A variant that is refused or cannot be computed has a reason, and NaN
    for its measures.

    Args:   study: a study file (TOML), or its tables.
            out: folder for the Parquet dataset; None: none is kept.
            workers: number of processes; default: all processors. Results do not depend on it.
            scheduler: processes, threads, or the address of a Dask scheduler, which runs code as
            you.
            resume: compute the missing rows of this study in `out`.
            part: "i/n", i from 1: every n-th part of the rows alone, into a folder that all n
            share, in any order and as often as needed; "/n" in an array of SLURM or HTCondor. It
            returns the rows of this part.
            minutes: end before so many have passed, between two parts; those that are left are
            missing.
            mechanism, motion, load: instead of those that the study names.
    Raises: InputError: for a study that cannot be solved, before the computation starts.
            LostWorkerError: if a worker was killed; finished parts are kept.
    """
    began = time.monotonic()
    check_scheduler(workers, scheduler)
    share = None if part is None else Share.read(part)
    if share is not None and out is None:
        raise InputError("part: expected a folder `out`, which all parts of the sweep share")
    end = math.inf
    if minutes is not None:
        end = began + 60 * as_number(minutes, "minutes", "a positive number", lambda x: x > 0)
    motions = None if motion is None else (as_motion(motion),)
    acting = None if load is None else as_load(load)
    with step("checking the study"):
        job = prepared(Study.read(study), mechanism, motions, acting)
    with ExitStack() as stack:
        if out is None:
            out = Path(stack.enter_context(TemporaryDirectory())) / "sweep"
        parts = range(job.parts) if share is None else share.of(range(job.parts))
        store = Store(job, out, resume or share is not None)
        missing = store.missing(parts)
        longest = 0.0  # s of a worker for a part
        with step("solving variants", len(parts) * job.part * len(job.motions)) as advance:
            advance((len(parts) - len(missing)) * job.part * len(job.motions))
            for number, rows in run_parts(job, solve_part, missing, workers, scheduler):
                store.write(number, rows)
                advance(rows.table.num_rows)
                longest = max(longest, sum(rows.table[SECONDS].to_pylist()))
                if time.monotonic() + longest > end:
                    break
        if share is None and not store.missing(parts):
            store.join()
        return open_sweep(out, part)
