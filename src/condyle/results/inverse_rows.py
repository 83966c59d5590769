"""Efforts of states, one a row: a file in, a file out."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, as_flag, as_path
from ..files.atomic import replacing
from ..kinematics.causes import require_ok
from ..mechanism.vocabulary import words_of
from ..model.given import as_model
from ..model.inverse_dynamics import SOLVED
from ..model.joint_reactions import reactions as joint_reactions
from ..motion.written_values import Values
from ..quantities import named_columns, variables
from ..quantities.entries import AXES, labels_of
from .derived import Derived
from .mat_file import table_variables, write_mat
from .noise import deviation_columns, deviations_of
from .row_stream import Columns, StateReader, StatesReport, contact_and_status, row_stream
from .summary import peak
from .warnings import Watch


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

    Args:    model: one, or a mechanism, the path of a file, or the name of a bundled one.
             states: States (CSV or Parquet), one per row: 6 - k pose coordinates such as X, Y (m),
             alpha, beta (rad), their rates dX ... (per s) and accelerations ddX ... (per s^2; at
             rest without both), and, if any, Fx, Fy, Fz (N), Mx, My, Mz (N m), gravity gx, gy, gz
             (m/s^2) and the base's motion base_ax ... base_dwz. Other columns are named in a
             warning, or refused if they look misspelt.
             out: File for the results (.csv or .parquet).
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
    if mat is not None and Path(as_path(mat, "mat")) == Path(as_path(out, "out")):
        raise InputError(f"--out {out}: --mat writes that file; give the table another name")
    model, flag, reactions = as_model(model), as_flag(flag, "flag"), as_flag(reactions, "reactions")
    mechanism, reader = model.mechanism, StateReader(model, load_point, threads)
    deviations = None if noise is None else deviations_of(model, noise)
    watch = Watch(mechanism, rows=True)
    greatest: dict[str, Any] = {}  # activation: effort over its limit
    chunks: list[Columns] = []
    more = ["contact_active"] if model.distribution.unilateral == "release" else []
    with (
        nullcontext() if mat is None else replacing(mat) as matlab,
        row_stream(states, out, reader.known, strict=strict, max_error=max_error) as rows,
    ):
        for table in rows:
            if deviations is not None:
                reader.require_independent(table, "noise is that of")
            state = reader.state(table)
            result = model.inverse_dynamics(
                **state, outputs=(*SOLVED, "ambiguous", *more), threads=threads
            )
            if not flag:
                require_ok(
                    mechanism,
                    result,
                    row_offset=rows.count,
                    free_motion=model.poses.free_motion_text,
                )
            derived = Derived(mechanism, result, state["wrench"], model.limited)
            watch.see(derived, rows.count + 1 + np.arange(table.rows))
            largest = peak(np.where(derived.ok[:, None], derived.activation, np.nan))
            if largest is not None and abs(largest[2]) > greatest.get("value", -1):
                row, chain, value = largest
                greatest = {"value": abs(value), "chain": mechanism.chain_names[chain]}
                greatest["row"] = rows.count + row + 1

            columns: Columns = {}
            for variable in variables().values():
                if variable.column is not None and derived.has(variable):
                    columns |= variable.table(derived.filled(variable), labels_of(mechanism))
            if reactions:
                acting = {name: state[name] for name in ("gravity", "base") if name in state}
                for name, reaction in joint_reactions(model, result, **acting).items():
                    array = np.where(derived.ok[:, None], reaction.array, np.nan)
                    columns |= named_columns(f"reaction_{name}_", AXES, array)
            if deviations is not None:
                columns |= deviation_columns(model, derived.ok, deviations, state)
            columns |= contact_and_status(derived, flag)
            rows.write(columns, result.bound)
            if matlab is not None:
                chunks.append(columns)
        rows.warnings += reader.rest(table)
        rows.warnings += [notice.text for notice in watch.notices()]
        if matlab is not None:
            joined = {name: np.concatenate([chunk[name] for chunk in chunks]) for name in columns}
            write_mat(matlab, table_variables(mechanism, joined))
    if mat is not None:
        rows.files.append(Path(mat))
    return rows.report(
        words_of(mechanism),
        mechanism=mechanism.name,
        formulation=model.formulation,
        route=model.route,
        distribution=model.distribution.name,
        greatest_activation=greatest or None,
    )
