"""Accelerations from states and efforts, one sample a row: a file in, a file out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import (
    AmbiguousError,
    JammedError,
    NumberRangeError,
    SampleError,
    SingularError,
    as_flag,
)
from ..kinematics.causes import ERRORS, FLAG, Owner, cause_text, causes, owners, sample_error
from ..kinematics.constraints import indices
from ..model.given import as_model
from ..model.model import Model
from ..model.model_result import ModelResult
from ..motion import NumberTable
from ..quantities import QUANTITIES, named_columns
from ..quantities.entries import labels_of
from ..status import Status
from .accuracy import max_error_of, require_accuracy
from .contacts import contact_loss, contact_loss_columns
from .failed_samples import status_columns
from .state_rows import Columns, StateColumns, StatesReport


def forward_states(
    model: Any,
    states: str | Path,
    out: str | Path,
    load_point: str | None = None,
    flag: bool = False,
    threads: int | None = None,
    strict: bool = False,
    max_error: float | None = None,
) -> StatesReport:
    """Forward dynamics of every row of a file; the output appears whole or not at all.

    Rows are independent.

    Args:    model: one, or a mechanism, the path of a file, or the name of a bundled one.
             states: CSV, or Parquet if its name ends in .parquet, with 6 - k pose coordinates,
             their rates dX... (none: at rest), tau_<chain> of every chain, and optionally some of
             Fx, Fy, Fz, Mx, My, Mz, gravity (gx, gy, gz) and the base's motion (base_ax ...
             base_dwz), as of motions. Other columns are named in a warning.
             out: ddX... of the given coordinates, contact_<contact>, the pose, joint_<chain>, and
             contact_loss_<contact> of unilateral contacts; with `flag` also status and cause.
             flag: keep rows that have no accelerations, empty, with a status.
             strict: a warning is an error.
             max_error: largest bound of the relative error that is accepted; with it there is a
             column bound.
    Raises:  InputError, SampleError, WarningError: nothing is written then.
    """
    flag, model = as_flag(flag, "flag"), as_model(model)
    max_error = max_error_of(max_error)
    mechanism = model.mechanism
    efforts = QUANTITIES["effort"].dimensions(mechanism)
    given = StateColumns(
        model,
        ("d",),
        "no rates (dX ...) are given",
        "(dX ...), and efforts tau_<chain>",
        efforts,
    )
    labels = labels_of(mechanism)
    pulled = np.zeros(len(mechanism.contacts), dtype=int)

    def solved(table: NumberTable, first_row: int) -> Columns:
        names = given.names(table)
        q, q1, _ = given.states(table, names, threads)
        effort, (wrench, at) = table.require([*efforts]), given.loads(table, load_point)
        found = model.forward_dynamics(
            q,
            q1,
            effort,
            wrench,
            at,
            **given.given(table),
            outputs=("pose", "pose_acceleration", "joint"),
            threads=threads,
        )
        cause = _causes(model, found, flag, first_row)
        good = (found.status == Status.ok)[:, None]
        pose, joint = (np.where(good, a, np.nan) for a in (found.pose, found.joint))
        columns: Columns = {}
        columns |= named_columns("dd", names, found.pose_acceleration[:, indices(names)])
        for name, values in (
            ("contact_force", found.contact_force),
            ("pose", pose),
            ("joint", joint),
        ):
            columns |= QUANTITIES[name].table(values, labels)
        if max_error is not None:
            require_accuracy(found.bound, max_error, first_row=first_row)
            columns["bound"] = found.bound
        lost = contact_loss(mechanism, np.nan_to_num(found.contact_force))
        pulled[:] += lost.sum(axis=0)
        columns |= contact_loss_columns(mechanism, lost)
        return columns | status_columns(mechanism, found.status, cause) if flag else columns

    def done() -> list[str]:
        return [
            f'the unilateral contact "{name}" would have to pull in {count} rows'
            for name, count in zip(mechanism.contact_names, pulled, strict=True)
            if count
        ]

    rows, warnings = given.stream(states, out, solved, done, strict)
    data = {"mechanism": mechanism.name, "formulation": model.formulation, "rows": rows}
    return StatesReport(data | {"warnings": warnings, "files": [Path(out)]})


def _causes(model: Model, found: ModelResult, flag: bool, first_row: int) -> np.ndarray:
    """What each row fails by, (N,), as `causes` counts.

    Raises: SampleError: for rows that fail, unless they are kept.
    """
    if not found.status.any():
        return np.zeros(len(found.status), dtype=np.int16)
    c = model.poses.configuration(found.pose)
    about = found.status, found.pose, c.discriminant, c.singularity
    cause = causes(*about)
    if flag:
        return cause
    bad = np.flatnonzero(found.status)
    status = list(Status)[found.status[bad[0]]]
    if status == Status.unreachable:
        error = sample_error(model.mechanism, *about, first_row=first_row)
        assert error is not None
        raise error
    raise _error(status, owners(model.mechanism)[cause[bad[0]]], bad, first_row)


def _error(status: Status, owner: Owner, bad: np.ndarray, first_row: int) -> SampleError:
    """Why the first of the rows `bad` has no accelerations."""
    row = first_row + int(bad[0]) + 1
    more = f" {bad.size - 1} more rows fail too." if bad.size > 1 else ""
    if status == Status.jammed:
        kind: type[SampleError] = JammedError
        text = f"the mechanism jams at row {row}: friction at the contacts has no consistent "
        text += "pattern of signs under these efforts"
        hint = "Rigid bodies have no solution there; less friction or other efforts have one"
    elif status == Status.ambiguous:
        kind = AmbiguousError
        text = f"several motions follow from the efforts at row {row}: friction at the contacts "
        text += "has more than one consistent pattern of signs"
        hint = "Rigid bodies have no single solution there; less friction or other efforts have one"
    elif status == Status.singular:
        kind, text = SingularError, f"the mechanism is singular at row {row}"
        if owner.kind == "chain":
            text += f" ({cause_text(status, owner)})"
        hint = "Accelerations are not determined there; avoid the pose"
    elif status in (Status.gimbal_lock, Status.overlap):
        kind, text, hint = ERRORS[status]
        text = text.format(f"row {row}")
    else:
        kind, text = NumberRangeError, f"the accelerations at row {row} are not finite"
        hint = "Its rates, efforts or load are too large for numbers"
    chain = owner.name if owner.kind == "chain" else None
    return kind(f"{text}.{more}", bad.tolist(), hint=f"{hint}, {FLAG}", row=row, chain=chain)
