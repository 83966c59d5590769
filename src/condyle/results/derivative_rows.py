"""Derivatives at states, one a row: a file in, a file out; see `Model.derivatives`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, SampleError, as_flag
from ..model.derivatives import Derivatives, names_of
from ..model.given import as_model
from ..model.model import Model
from ..motion import NumberTable
from ..quantities import QUANTITIES
from ..status import STATUS_NAMES, Status
from .state_rows import Columns, StateColumns, StatesReport

DYNAMIC, KINEMATIC = ("effort", "contact_force", "acceleration"), ("pose", "joint", "contact_point")


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
    """Derivatives at every row of a file, in columns such as "d tau_<chain> / d X" [SI].

    Rows are independent.

    Args:    model: one, or a mechanism, the path of a file, or the name of a bundled one.
             states: as of `solve_states`, with the independent coordinates; for `acceleration` as
             of `forward_states`.
             out: CSV, or Parquet if its name ends in .parquet.
             of, wrt: names, as of `Model.derivatives`.
             flag: keep rows without derivatives, empty; with it, and at kinks, status says why.
             zeros: as of `Model.derivatives`.
    Raises:  InputError, SampleError, WarningError: nothing is written then.
    """
    model, flag = as_model(model), as_flag(flag, "flag")
    of, wrt = names_of(of, "of"), names_of(wrt, "wrt")
    if other := [name for name in of if name not in (*DYNAMIC, *KINEMATIC, "singularity_ratio")]:
        raise InputError(
            f"of: there is no {other[0]!r} of states; available: "
            f"{', '.join((*DYNAMIC, *KINEMATIC, 'singularity_ratio'))}"
        )
    forward, mechanism = "acceleration" in of, model.mechanism
    own = QUANTITIES["effort"].dimensions(mechanism)
    rates = ("d",) if forward else ("d", "dd")
    missing, wanted = "no rates are given", "(dX ...)"
    given = StateColumns(model, rates, missing, wanted, own if forward else {})
    kinks, home_kept = 0, tuple[str, ...]()

    def solved(table: NumberTable, first_row: int) -> Columns:
        nonlocal kinks, home_kept
        names = given.names(table)
        if {*names} != {*model.independent}:
            raise InputError(
                f"{table.source} gives {', '.join(names)}; derivatives are taken by the "
                f"independent coordinates {', '.join(model.independent)}: give these"
            )
        q, v, a = given.states(table, names, None)
        wrench, at = given.loads(table, load_point)
        state: dict[str, Any] = {"q": q, "v": v, "wrench": wrench, "at": at, **given.given(table)}
        state |= {"effort": table.require([*own])} if forward else {"a": a}
        d = model.derivatives(of, wrt, **state, zeros=zeros)
        bad = ~np.isin(d.status, (Status.ok, Status.kink))
        if bad.any() and not flag:
            row = int(np.argmax(bad))
            raise SampleError(
                f"row {first_row + row + 1} has no derivatives: "
                f"{list(Status)[d.status[row]].meaning}. "
                "--flag (flag=True) keeps such rows, empty",
                [first_row + row],
                row=first_row + row + 1,
            )
        kinks, home_kept = kinks + int((d.status == Status.kink).sum()), d.home_kept
        columns: Columns = dict(_columns(model, d, of, wrt))
        if flag or (d.status != Status.ok).any():
            columns["status"] = [STATUS_NAMES[i] for i in d.status.tolist()]
        return columns

    rows, warnings = given.stream(states, out, solved, strict=strict)
    return StatesReport(
        {
            "mechanism": mechanism.name,
            "distribution": model.distribution.name,
            "rows": rows,
            "kinks": kinks,
            "home_kept": list(home_kept),
            "warnings": warnings,
            "files": [Path(out)],
        }
    )


def _columns(
    model: Model, d: Derivatives, of: tuple[str, ...], wrt: tuple[str, ...]
) -> Iterator[tuple[str, np.ndarray]]:
    for name in of:
        results = QUANTITIES[name].columns(model.mechanism)
        for by in wrt:
            a = d[name, by].reshape(len(d.status), len(results), -1)
            for i, result in enumerate(results):
                for j, argument in enumerate(_arguments(model, by, d[name, by].shape[1:], a)):
                    yield f"d {result} / d {argument}", a[:, i, j]


def _arguments(model: Model, by: str, shape: tuple[int, ...], a: np.ndarray) -> list[str]:
    """Names of what it is taken by, entry by entry."""
    if by in ("q", "v", "a", "wrench", "base", "effort"):
        return QUANTITIES[by].columns(model.mechanism)
    if a.shape[2] == 1:
        return [by]
    if "*" not in by:
        return [f"{by}[{j}]" for j in range(a.shape[2])]
    part = by.split(".")[0]
    names = getattr(model.mechanism, f"{part}_names")
    each = a.shape[2] // len(names)
    ends = [""] if each == 1 else [f"[{j}]" for j in range(each)]
    return [by.replace("*", name, 1) + end for name in names for end in ends]
