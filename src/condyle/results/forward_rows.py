"""Accelerations from states and efforts, one sample a row: a file in, a file out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import AmbiguousError, JammedError, NumberRangeError, SingularError, as_flag
from ..kinematics import causes
from ..kinematics.causes import require_ok
from ..kinematics.constraints import indices
from ..mechanism.vocabulary import words_of
from ..model.given import as_model
from ..model.model_result import ModelResult
from ..quantities import QUANTITIES, named_columns
from ..quantities.entries import labels_of
from ..status import Status
from .derived import Derived
from .row_stream import Columns, StateReader, StatesReport, contact_and_status, row_stream

# Why a row has no accelerations, where efforts given are the reason.
ERRORS: dict[Status, causes.StatusError] = causes.ERRORS | {
    Status.jammed: (
        JammedError,
        "the mechanism jams at {}: friction at the contacts has no consistent pattern of signs "
        "under these efforts",
        "Rigid bodies have no solution there; less friction or other efforts have one",
    ),
    Status.ambiguous: (
        AmbiguousError,
        "several motions follow from the efforts at {}: friction at the contacts has more than one "
        "consistent pattern of signs",
        "Rigid bodies have no single solution there; less friction or other efforts have one",
    ),
    Status.singular: (
        SingularError,
        "the mechanism is singular at {}",
        "Accelerations are not determined there; avoid the pose",
    ),
    Status.overflow: (
        NumberRangeError,
        "the accelerations at {} are not finite",
        "Its rates, efforts or load are too large for numbers",
    ),
}


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
    """Forward dynamics of independent states, one per row; the output is complete or absent.

    Args:    model: one, or a mechanism, the path of a file, or the name of a bundled one.
             states: States and efforts (CSV or Parquet), one per row: the columns that `condyle
             solve` reads without accelerations, and tau_<chain> of every chain (N m, or N where it
             slides or pulls).
             out: ddX... of the given coordinates, contact_<contact>, the pose, joint_<chain>, and
             contact_loss_<contact> of unilateral contacts; with `flag` also status and cause.
             flag: keep rows that have no accelerations, empty, with a status.
             strict: a warning is an error.
             max_error: largest bound of the relative error that is accepted; with it there is a
             column bound.
    Raises:  InputError, SampleError, WarningError: nothing is written then.
    """
    model, flag = as_model(model), as_flag(flag, "flag")
    mechanism, reader = model.mechanism, StateReader(model, load_point, threads, by_effort=True)
    pulled = np.zeros(len(mechanism.contacts), dtype=int)
    with row_stream(states, out, reader.known, strict=strict, max_error=max_error) as rows:
        for table in rows:
            outputs = ("pose", "pose_acceleration", "joint")
            state, names = reader.state(table), reader.names(table)
            result = model.forward_dynamics(**state, outputs=outputs, threads=threads)
            if result.status.any():
                configuration = model.poses.configuration(result.pose)
                result = ModelResult(**vars(result), configuration=configuration)
                if not flag:
                    require_ok(mechanism, result, row_offset=rows.count, errors=ERRORS)
            derived = Derived(mechanism, result)
            acceleration = result.pose_acceleration[:, indices(names)]
            columns: Columns = {**named_columns("dd", names, acceleration)}
            for name in ("contact_force", "pose", "joint"):
                values = derived.filled(QUANTITIES[name])
                columns |= QUANTITIES[name].table(values, labels_of(mechanism))
            columns["bound"] = result.bound
            pulled += derived.contact_loss.sum(axis=0)
            rows.write(columns | contact_and_status(derived, flag), result.bound)
        rows.warnings += reader.rest(table)
        say = words_of(mechanism)
        rows.warnings += [
            say(f'the unilateral contact "{name}" would have to pull in {count} rows')
            for name, count in zip(mechanism.contact_names, pulled, strict=True)
            if count
        ]
    return rows.report(mechanism=mechanism.name, formulation=model.formulation)
