"""States and efforts, one sample a row: a file in, accelerations out, in flat memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import (
    InputError,
    JammedError,
    NumberRangeError,
    SampleError,
    SingularError,
)
from ..kinematics.causes import FLAG, Owner, cause_text, causes, owners, sample_error
from ..kinematics.chain import FAMILIES
from ..kinematics.constraints import indices
from ..mechanism.mechanism import COORDINATES
from ..model.data import Accelerations
from ..model.evaluator import Evaluator, with_point
from ..motion import Table, TableWriter, iter_table
from ..motion.column_units import Dimension, dimension
from ..status import Status
from .contacts import lift_off, lift_off_columns
from .failures import status_columns
from .solution import named_columns
from .states import CHUNK_ROWS, loads
from .variables import WRENCH

AT_REST = "no rates (dX ...) are given: the states are at rest"
KINDS = {"N m": "moment", "N": "force"}


def forward_file(
    model: Evaluator,
    states: str | Path,
    out: str | Path,
    load_point: str | None = None,
    flag: bool = False,
    threads: int | None = None,
) -> tuple[int, list[str]]:
    """Forward dynamics of every row of a file; the output appears whole or not at all.

    Rows never influence each other.

    Args:    states: CSV, or Parquet if its name ends in .parquet, with 6 - k pose coordinates,
             their rates dX... (none: at rest), tau_<chain> of every chain, and optionally some of
             Fx, Fy, Fz, Mx, My, Mz. Other columns are named in a warning.
             out: ddX... of the given coordinates, contact_<contact>, the pose, joint_<chain>, and
             lift_off_<contact> of one-sided contacts; with `flag` also status and cause.
             flag: keep rows that have no accelerations, empty, with a status.
    Returns: number of rows, and warnings.
    Raises:  InputError, SampleError: nothing is written then.
    """
    rows, unused = 0, list[str]()
    pulled = np.zeros(len(model.mechanism.contacts), dtype=int)
    with TableWriter(out) as writer:
        for table in iter_table(states, CHUNK_ROWS, known=_known(model), doing="solving"):
            columns, lifted = forward_table(model, table, load_point, flag, rows, threads)
            writer.write(columns)
            rows += table.rows
            pulled += lifted.sum(axis=0)
            unused = list(table.warnings)
            if _at_rest(table):
                unused.append(
                    f"{table.source}: no rates (dX ...) are given: the states are at rest"
                )
    names = model.mechanism.contact_names
    return rows, [
        *unused,
        *(
            f'one-sided contact "{name}" would have to pull in {count} of {rows} rows'
            for name, count in zip(names, pulled, strict=True)
            if count
        ),
    ]


def forward_table(
    model: Evaluator,
    table: Table,
    load_point: str | None,
    flag: bool,
    first_row: int,
    threads: int | None = None,
) -> tuple[dict[str, np.ndarray | list[str]], np.ndarray]:
    """Output columns for the rows of one table, and where one-sided contacts would pull, (N, k)."""
    mechanism = model.mechanism
    names = _coordinates(model, table)
    q = table.require(names)
    q1 = np.zeros_like(q) if _at_rest(table) else table.require([f"d{name}" for name in names])
    effort = table.require([f"tau_{name}" for name in mechanism.chain_names])
    q, q1, _ = model.independent_states(names, q, q1, np.zeros_like(q), threads=threads)
    load = with_point(*loads(model, table, load_point))
    found = model.forward(q, q1, effort, load, ("motion", "joint"), threads)
    cause = _causes(model, found, flag, first_row)
    good = found.status == Status.ok

    def filled(array: np.ndarray) -> np.ndarray:
        return np.where(good[:, None], array, np.nan)

    pose, second = filled(found["pose"]), found["pose_acceleration"]
    columns: dict[str, np.ndarray | list[str]] = {}
    columns |= named_columns("dd", names, second[:, indices(names)])
    columns |= named_columns("contact_", mechanism.contact_names, found.contact_force)
    columns |= named_columns("", COORDINATES, pose)
    columns |= named_columns("joint_", mechanism.chain_names, filled(found["joint"]))
    lifted = lift_off(mechanism, np.nan_to_num(found.contact_force))
    columns |= lift_off_columns(mechanism, lifted)
    if flag:
        columns |= status_columns(mechanism, found.status, cause)
    return columns, lifted


def _known(model: Evaluator) -> dict[str, Dimension]:
    """What columns there may be, and what they are."""
    poses = [prefix + name for prefix in ("", "d") for name in COORDINATES]
    known = {name: kind for name in (*poses, *WRENCH) if (kind := dimension(name)) is not None}
    for chain in model.mechanism.chains:
        known[f"tau_{chain.name}"] = KINDS[FAMILIES[chain.kind].effort_unit], 0
    return known


def _at_rest(table: Table) -> bool:
    return not any(f"d{name}" in table.columns for name in COORDINATES)


def _coordinates(model: Evaluator, table: Table) -> list[str]:
    """The pose coordinates that a file gives."""
    names = [name for name in COORDINATES if name in table.columns]
    if len(names) != len(model.independent):
        raise InputError(
            f"{table.source}: got the pose coordinates {', '.join(names) or 'none'}; a state of "
            f"this mechanism has {len(model.independent)}, such as {', '.join(model.independent)}, "
            "with their rates (dX ...), and efforts tau_<chain>"
        )
    return names


def _causes(model: Evaluator, found: Accelerations, flag: bool, first_row: int) -> np.ndarray:
    """What each row fails by, (N,), as `causes` counts.

    Raises: SampleError: for rows that fail, unless they are kept.
    """
    if not found.status.any():
        return np.zeros(len(found.status), dtype=np.int16)
    c = model.configuration(found["pose"])
    about = found.status, found["pose"], c.discriminant, c.singularity
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
        text += "pattern of signs under these efforts, or several"
        hint = "There is no one answer with rigid bodies; less friction or other efforts have one"
    elif status == Status.singular:
        kind, text = SingularError, f"the mechanism is singular at row {row}"
        if owner.kind == "chain":
            text += f" ({cause_text(status, owner)})"
        hint = "Accelerations are not determined there; avoid the pose"
    else:
        kind, text = NumberRangeError, f"the accelerations at row {row} are not finite"
        hint = "Its rates, efforts or load are too large for numbers"
    chain = owner.name if owner.kind == "chain" else None
    return kind(f"{text}.{more}", bad.tolist(), hint=f"{hint}, {FLAG}", row=row, chain=chain)
