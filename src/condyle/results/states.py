"""Independent states, one a row: a file in, a file out, in flat memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import BoundsError, InputError
from ..mechanism.mechanism import COORDINATES
from ..model.evaluator import Evaluator, with_point
from ..model.judge import require_ok
from ..model.reactions import reactions as joint_reactions
from ..motion import Table, TableWriter, iter_table
from ..status import STATUS_NAMES
from .solution import (
    AXES,
    BOUND_TOLERANCE,
    WRENCH,
    bound_margins,
    lift_off,
    lift_off_columns,
    named_columns,
)

CHUNK_ROWS = 16384


def solve_file(
    model: Evaluator,
    states: str | Path,
    out: str | Path,
    load_point: str | None = None,
    flag: bool = False,
    strict: bool = False,
    reactions: bool = False,
    threads: int | None = None,
) -> tuple[int, list[str]]:
    """Solve every row of a states file; the output appears whole or not at all.

    Rows never influence each other.

    Args:    states: CSV, or Parquet if its name ends in .parquet, with 6 - k pose coordinates,
             their rates dX... and accelerations ddX..., and optionally some of Fx, Fy, Fz, Mx,
             My, Mz. Other columns are named in a warning, or refused if they look misspelt.
             out: likewise CSV or Parquet.
             reactions: columns reaction_<joint>_<chain>_x, _y, _z ... too.
             threads: at most so many; the file does not depend on it.
    Returns: number of rows, and warnings.
    Raises:  InputError, UnreachableError, SingularError, BoundsError: nothing is written then.
    """
    known = [p + name for p in ("", "d", "dd") for name in COORDINATES] + list(WRENCH)
    worst: dict[str, tuple[float, int, int]] = {}
    lifts: dict[str, tuple[int, int]] = {}
    rows, unused = 0, list[str]()
    with TableWriter(out) as writer:
        for table in iter_table(states, CHUNK_ROWS, known=known, doing="solving"):
            columns, margins, lifted = solve_table(
                model, table, load_point, flag, rows, reactions, threads
            )
            for i, name in enumerate(model.mechanism.contact_names):
                outside = np.flatnonzero(margins[:, i] < -BOUND_TOLERANCE)
                if outside.size:
                    row = int(outside[np.argmin(margins[outside, i])])
                    depth, count, at = worst.get(name, (0.0, 0, 0))
                    if -margins[row, i] > depth:
                        depth, at = -margins[row, i], rows + row + 1
                    worst[name] = (depth, count + outside.size, at)
                if (pulls := np.flatnonzero(lifted[:, i])).size:
                    first, count = lifts.get(name, (rows + int(pulls[0]) + 1, 0))
                    lifts[name] = (first, count + pulls.size)
            writer.write(columns)
            rows += table.rows
            unused = list(table.warnings)
        warnings = [
            f'contact "{name}" is outside its bounds in {count} rows, by up to '
            f"{depth * 1e3:.3g} mm in row {at}"
            for name, (depth, count, at) in worst.items()
        ]
        if strict and warnings:
            raise BoundsError("; ".join(warnings) + ". Without --strict this is a warning", [])
    warnings += [
        f'contact "{name}" lifts off in {count} rows, first in row {first}: there its surface '
        "would have to pull the ball"
        for name, (first, count) in lifts.items()
    ]
    return rows, unused + warnings


def solve_table(
    model: Evaluator,
    table: Table,
    load_point: str | None,
    flag: bool,
    first_row: int,
    reactions: bool = False,
    threads: int | None = None,
) -> tuple[dict[str, np.ndarray | list[str]], np.ndarray, np.ndarray]:
    """Output columns for the rows of one table; bound margins and lift-off, (N, k)."""
    names = state_coordinates(model, table)
    q, q1, q2 = (table.require([p + name for name in names]) for p in ("", "d", "dd"))
    q, q1, q2 = model.independent_states(names, q, q1, q2)
    wrench = np.zeros((table.rows, 6))
    point = np.zeros(3)
    given = [name for name in WRENCH if name in table.columns]
    for name in given:
        wrench[:, WRENCH.index(name)] = table.columns[name]
    if load_point is not None or set(given) & set(WRENCH[:3]):
        point = model.load_point(load_point)
    evaluation = model.evaluate(q, q1, q2, with_point(wrench, point), threads)
    ok = evaluation.status == 0
    if not flag and not ok.all():
        require_ok(model.mechanism, evaluation, row_offset=first_row)
    mechanism = model.mechanism
    values = {
        "tau_": (mechanism.chain_names, evaluation.effort),
        "contact_": (mechanism.contact_names, evaluation.contact_force),
        "": (COORDINATES, evaluation.pose),
        "joint_": (mechanism.chain_names, evaluation.configuration.joint),
    }
    columns: dict[str, np.ndarray | list[str]] = {}
    for prefix, (labels, array) in values.items():
        columns |= named_columns(prefix, labels, np.where(ok[:, None], array, np.nan))
    if reactions:
        for name, reaction in joint_reactions(model, evaluation).items():
            array = np.where(ok[:, None], reaction.array, np.nan)
            columns |= {f"reaction_{name}_{axis}": array[:, i] for i, axis in enumerate(AXES)}
    force = evaluation.contact_force
    lifted = lift_off(mechanism, force) & ok[:, None]
    columns |= lift_off_columns(mechanism, lifted)
    if flag:
        columns["status"] = np.array(STATUS_NAMES)[evaluation.status]
    margins = bound_margins(mechanism, evaluation.configuration.contact_point)
    return columns, np.where(ok[:, None], margins, np.inf), lifted


def state_coordinates(model: Evaluator, table: Table) -> list[str]:
    """The pose coordinates that a states file gives."""
    names = [name for name in COORDINATES if name in table.columns]
    m = model.mechanism.degrees_of_freedom
    if len(names) != m:
        raise InputError(
            f"{table.source}: got the pose coordinates {', '.join(names) or 'none'}; a state of "
            f"this mechanism has {m}, such as {', '.join(model.independent)}, with their rates "
            "(dX ...) and accelerations (ddX ...)"
        )
    used = {prefix + name for prefix in ("", "d", "dd") for name in names} | {*WRENCH}
    if idle := [name for name in table.columns if name not in used]:
        raise InputError(
            f"{table.source}: {', '.join(idle)} would not be used: the state is given by "
            f"{', '.join(names)}, their rates and accelerations. Remove what is not of these"
        )
    return names
