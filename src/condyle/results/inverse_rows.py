"""Efforts of states, one a row: a file in, a file out."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from ..atomic import replacing
from ..errors import InputError, as_flag, as_path
from ..model.given import as_model
from ..model.inverse_dynamics import SOLVED
from ..model.joint_reactions import reactions as joint_reactions
from ..model.model import Model
from ..model.model_result import require_ok
from ..motion import NumberTable
from ..motion.column_units import BASE, GRAVITY
from ..motion.written_values import Values
from ..quantities import variables
from ..quantities.entries import AXES, WRENCH, labels_of
from .accuracy import max_error_of, require_accuracy
from .contacts import contact_loss_columns
from .derived import Derived
from .failed_samples import status_columns
from .mat_file import table_variables, write_mat
from .noise import deviation_columns, deviations_of
from .state_rows import Columns, StateColumns, StatesReport
from .summary import peak
from .warnings import Watch


def state_columns(model: Model) -> StateColumns:
    """What a file of states has."""
    missing = "no rates (dX ...) and no accelerations (ddX ...) are given"
    return StateColumns(model, ("d", "dd"), missing, "(dX ...) and accelerations (ddX ...)")


def solve_states(
    model: Any,
    states: str | Path,
    out: str | Path,
    load_point: str | None = None,
    flag: bool = False,
    strict: bool = False,
    reactions: bool = False,
    threads: int | None = None,
    mat: str | Path | None = None,
    max_error: float | None = None,
    noise: Values | None = None,
) -> StatesReport:
    """Inverse dynamics of independent states, one per row; the output is complete or absent.

    Rows are independent.

    Args:    model: one, or a mechanism, the path of a file, or the name of a bundled one.
             states: CSV, or Parquet if its name ends in .parquet, with 6 - k pose coordinates,
             their rates dX... and accelerations ddX... (without any of both the states are at
             rest), and optionally some of Fx, Fy, Fz, Mx, My, Mz, gravity (gx, gy, gz) and the
             base's motion (base_ax ... base_dwz), as of motions. Other columns are named in a
             warning, or refused if they look misspelt.
             out: likewise CSV or Parquet.
             reactions: columns reaction_<joint>_<chain>_x, _y, _z ... too.
             strict: a warning is an error.
             threads: maximum number of threads; the file does not depend on it.
             max_error: largest bound of the relative error that is accepted; with it there is a
             column bound.
             noise: standard deviations of independent coordinates, their rates and accelerations,
             and numbers of the file in SI, "X=0.01 mm,dX=1 mm/s,platform.mass=0.01" or by name in
             SI: columns sd_tau_<chain> too.
             mat: file for MATLAB to write as well; it takes the memory of the whole table.
    Raises:  InputError, SampleError, WarningError: nothing is written then.
    """
    model, max_error = as_model(model), max_error_of(max_error)
    flag, reactions = as_flag(flag, "flag"), as_flag(reactions, "reactions")
    if mat is not None and Path(as_path(mat, "mat")) == Path(as_path(out, "out")):
        raise InputError(f"--out {out}: --mat writes that file; give the table another name")
    deviations = None if noise is None else deviations_of(model, noise)
    watch = Watch(model.mechanism, rows=True)
    greatest: dict[str, Any] | None = None  # effort over its limit
    kept: list[Columns] = []

    def solved(table: NumberTable, first_row: int) -> Columns:
        nonlocal greatest
        columns, derived = solve_table(
            model, table, load_point, flag, first_row, reactions, threads, deviations
        )
        if max_error is not None:
            columns["bound"] = derived.evaluation.bound
            require_accuracy(derived.evaluation.bound, max_error, first_row=first_row)
        watch.see(derived, np.arange(first_row, first_row + table.rows) + 1)
        greatest = _greater(greatest, derived, first_row)
        if mat is not None:
            kept.append(columns)
        return columns

    def done() -> list[str]:
        if matlab is not None:
            names = kept[0] if kept else {}
            whole = {name: np.concatenate([part[name] for part in kept]) for name in names}
            write_mat(matlab, table_variables(model.mechanism, whole))
        return [notice.text for notice in watch.notices()]

    with ExitStack() as stack:
        matlab = None if mat is None else stack.enter_context(replacing(mat))
        rows, warnings = state_columns(model).stream(states, out, solved, done, strict)
    return StatesReport(
        {
            "mechanism": model.mechanism.name,
            "formulation": model.formulation,
            "route": model.route,
            "distribution": model.distribution.name,
            "rows": rows,
            "greatest_activation": greatest,
            "warnings": warnings,
            "files": [Path(out), *([] if mat is None else [Path(mat)])],
        }
    )


def _greater(
    before: dict[str, Any] | None, derived: Derived, first_row: int
) -> dict[str, Any] | None:
    """The greatest activation so far: value, chain and row, from 1."""
    if (found := peak(np.where(derived.ok[:, None], derived.activation, np.nan))) is None:
        return before
    row, chain, value = found
    if before is not None and before["value"] >= abs(value):
        return before
    name = derived.mechanism.chain_names[chain]
    return {"value": abs(value), "chain": name, "row": first_row + row + 1}


def solve_table(
    model: Model,
    table: NumberTable,
    load_point: str | None,
    flag: bool,
    first_row: int,
    reactions: bool = False,
    threads: int | None = None,
    deviations: dict[str, np.ndarray] | None = None,
) -> tuple[Columns, Derived]:
    """Output columns for the rows of one table, and what follows from its evaluation."""
    given, mechanism = state_columns(model), model.mechanism
    names = given.names(table)
    used = {prefix + name for prefix in ("", *given.rates) for name in names}
    used |= {*WRENCH, *GRAVITY, *BASE}
    if idle := [name for name in table.columns if name not in used]:
        raise InputError(
            f"{table.source}: {', '.join(idle)} would not be used: the state is given by "
            f"{', '.join(names)}, their rates and accelerations. Remove the other columns"
        )
    if deviations is not None and {*names} != {*model.independent}:
        raise InputError(
            f"noise: {table.source} gives {', '.join(names)}; with noise states are given by "
            f"{', '.join(model.independent)}"
        )
    states = given.states(table, names, threads)
    wrench, at = given.loads(table, load_point)
    beside = given.given(table)
    evaluation = model.inverse_dynamics(
        *states, wrench, at, **beside, outputs=(*SOLVED, "ambiguous"), threads=threads
    )
    derived = Derived(mechanism, evaluation, wrench, model.limited)
    if not flag:
        require_ok(mechanism, evaluation, row_offset=first_row)

    columns: Columns = {}
    for variable in variables().values():
        if variable.column is not None and derived.has(variable):
            columns |= variable.table(derived.filled(variable), labels_of(mechanism))
    if reactions:
        for name, reaction in joint_reactions(model, evaluation, **beside).items():
            array = np.where(derived.ok[:, None], reaction.array, np.nan)
            columns |= {f"reaction_{name}_{axis}": array[:, i] for i, axis in enumerate(AXES)}
    if deviations is not None:
        columns |= deviation_columns(model, derived, deviations, states, wrench, at, beside)
    columns |= contact_loss_columns(mechanism, derived.contact_loss)
    if flag:
        shortfall = derived.shortfall if derived.limited else None
        columns |= status_columns(mechanism, evaluation.status, derived.cause, shortfall)
    return columns, derived
