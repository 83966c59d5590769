"""Derivatives at states, one a row: a file in, a file out; see `Model.derivatives`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, SampleError, as_flag, brief, did_you_mean
from ..model.derivatives import Derivatives, names_of
from ..model.given import as_model
from ..model.model import Model
from ..quantities import QUANTITIES
from ..status import STATUS_NAMES, Status
from .row_stream import Columns, StateReader, StatesReport, row_stream

RESULTS = (
    *("effort", "contact_force", "acceleration", "pose", "joint", "contact_point"),
    "singularity_ratio",
)


def derivative_states(
    model: Any,
    states: str | Path,
    out: str | Path,
    of: str | list[str] | tuple[str, ...] = "effort",
    wrt: str | list[str] | tuple[str, ...] = "q",
    load_point: str | None = None,
    flag: bool = False,
    zeros: bool = False,
    strict: bool = False,
) -> StatesReport:
    """Derivatives at independent states, one per row, such as "d tau_<chain> / d X" [SI].

    Args:    model: one, or a mechanism, the path of a file, or the name of a bundled one.
             states: States (CSV or Parquet), one per row, as `condyle solve` reads them, with the
             independent coordinates; for acceleration as `condyle forward` does.
             out: File for the derivatives (.csv or .parquet).
             of: Results: effort, contact_force, acceleration, pose, joint, contact_point or
             singularity_ratio; several times for several. Default: effort.
             wrt: Arguments: q, v, a, wrench, at, effort, gravity, base, or the path of a number of
             the mechanism file such as platform.mass; several times for several. Default: q.
             flag: keep rows without derivatives, empty; with it, and at kinks, status says why.
             zeros: Write zeros where a number cannot matter, instead of failing.
    Raises:  InputError, SampleError, WarningError: nothing is written then.
    """
    model, flag = as_model(model), as_flag(flag, "flag")
    of, wrt = names_of(of, "of"), names_of(wrt, "wrt")
    if other := [name for name in of if name not in RESULTS]:
        raise InputError(f"of: unknown result {brief(other[0])}.{did_you_mean(other[0], RESULTS)}")
    reader = StateReader(model, load_point, by_effort="acceleration" in of)
    kinks, home_kept = 0, tuple[str, ...]()
    with row_stream(states, out, reader.known, strict=strict) as rows:
        for table in rows:
            reader.require_independent(table, "derivatives are taken by")
            d = model.derivatives(of, wrt, **reader.state(table), zeros=zeros)
            bad = np.flatnonzero(~np.isin(d.status, (Status.ok, Status.kink)))
            if bad.size and not flag:
                row = rows.count + int(bad[0])
                raise SampleError(
                    f"row {row + 1} has no derivatives: {list(Status)[d.status[bad[0]]].meaning}. "
                    "--flag (flag=True) keeps such rows, empty",
                    [row],
                    row=row + 1,
                )
            kinks, home_kept = kinks + int((d.status == Status.kink).sum()), d.home_kept
            columns: Columns = dict(_columns(model, d, of, wrt))
            if not rows.count:
                with_status = flag or bool(d.status.any())
            if with_status:
                columns["status"] = [STATUS_NAMES[i] for i in d.status.tolist()]
            elif d.status.any():
                row = rows.count + int(d.status.argmax()) + 1
                raise InputError(
                    f"row {row} is at a kink, and the table was begun without the column status "
                    "that says so; --flag (flag=True) writes it"
                )
            rows.write(columns)
        rows.warnings += reader.rest(table)
    mechanism, distribution = model.mechanism.name, model.distribution.name
    return rows.report(
        mechanism=mechanism, distribution=distribution, kinks=kinks, home_kept=[*home_kept]
    )


def _columns(
    model: Model, d: Derivatives, of: tuple[str, ...], wrt: tuple[str, ...]
) -> Iterator[tuple[str, np.ndarray]]:
    for name in of:
        results = QUANTITIES[name].columns(model.mechanism)
        for by in wrt if results else ():
            a = d[name, by].reshape(len(d.status), len(results), -1)
            for i, result in enumerate(results):
                for j, argument in enumerate(_arguments(model, by, a.shape[2])):
                    yield f"d {result} / d {argument}", a[:, i, j]


def _arguments(model: Model, by: str, count: int) -> list[str]:
    """Names of what it is taken by, entry by entry."""
    if by in ("q", "v", "a", "wrench", "base", "effort"):
        return QUANTITIES[by].columns(model.mechanism)
    owners = getattr(model.mechanism, f"{by.split('.')[0]}_names") if "*" in by else [""]
    size = count // len(owners)
    ends = [""] if size == 1 else [f"[{j}]" for j in range(size)]
    return [by.replace("*", owner, 1) + end for owner in owners for end in ends]
