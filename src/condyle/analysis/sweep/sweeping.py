"""A sweep: a study is checked, solved in parts by any scheduler, and read back in its order."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import xarray as xr

from ...mechanism.mechanism import Mechanism
from ...motion import Load, Motion, as_load, as_motion
from ...progress import step
from ..workers import PROCESSES, check_scheduler, run_parts
from .job import prepared
from .part import solve_part
from .study import Study
from .study_folder import Store, open_sweep


def sweep(
    study: Study | str | os.PathLike[str] | Mapping[str, Any],
    out: str | os.PathLike[str] | None = None,
    *,
    workers: int | None = None,
    scheduler: str = PROCESSES,
    resume: bool = False,
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
            mechanism, motion, load: instead of those that the study names.
    Raises: InputError: for a study that cannot be solved, before the computation starts.
            LostWorkerError: if a worker was killed; finished parts are kept.
    """
    check_scheduler(workers, scheduler)
    motions = None if motion is None else (as_motion(motion),)
    acting = None if load is None else as_load(load)
    with step("checking the study"):
        job = prepared(Study.read(study), mechanism, motions, acting)
    with ExitStack() as stack:
        if out is None:
            out = Path(stack.enter_context(TemporaryDirectory())) / "sweep"
        store = Store(job, out, resume)
        missing = store.missing()
        with step("solving variants", job.rows) as advance:
            advance((job.parts - len(missing)) * job.part * len(job.motions))
            for part, rows in run_parts(job, solve_part, missing, workers, scheduler):
                store.write(part, rows)
                advance(rows.table.num_rows)
        store.join()
        return open_sweep(out)
