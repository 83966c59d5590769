"""Independent states, one a row: a file in, a file out, in flat memory."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..atomic import replacing
from ..errors import InputError
from ..mechanism.mechanism import COORDINATES
from ..model.evaluator import Evaluator, with_point
from ..model.judge import require_ok
from ..model.reactions import reactions as joint_reactions
from ..motion import Table, TableWriter, iter_table
from .contacts import AXES, lift_off_columns
from .derived import Derived
from .failures import status_columns
from .matlab import table_variables, write_mat
from .solution import named_columns
from .variables import VARIABLES, WRENCH
from .warnings import Watch, refuse

CHUNK_ROWS = 16384
AT_REST = "no rates (dX ...) and no accelerations (ddX ...) are given: the states are at rest"


class Activation(NamedTuple):
    """The largest effort over its limit: how much, of which chain, in which row (from 1)."""

    value: float
    chain: str
    row: int


class Solved(NamedTuple):
    """What came of a file of states; `greatest` is None without limits of efforts."""

    rows: int
    warnings: list[str]
    greatest: Activation | None


def solve_file(
    model: Evaluator,
    states: str | Path,
    out: str | Path,
    load_point: str | None = None,
    flag: bool = False,
    strict: bool = False,
    reactions: bool = False,
    threads: int | None = None,
    mat: str | Path | None = None,
) -> Solved:
    """Solve every row of a states file; the output appears whole or not at all.

    Rows never influence each other.

    Args:    states: CSV, or Parquet if its name ends in .parquet, with 6 - k pose coordinates,
             their rates dX... and accelerations ddX... (without any of both the states are at
             rest), and optionally some of Fx, Fy, Fz, Mx, My, Mz. Other columns are named in a
             warning, or refused if they look misspelt.
             out: likewise CSV or Parquet.
             reactions: columns reaction_<joint>_<chain>_x, _y, _z ... too.
             threads: at most so many; the file does not depend on it.
             mat: file for MATLAB to write as well; it takes the memory of the whole table.
    Returns: number of rows, warnings, and the greatest activation.
    Raises:  InputError, UnreachableError, SingularError, BoundsError: nothing is written then.
    """
    known = [p + name for p in ("", "d", "dd") for name in COORDINATES] + list(WRENCH)
    watch = Watch(model.mechanism, rows=True)
    rows, unused, greatest = 0, list[str](), None
    kept: list[dict[str, np.ndarray | list[str]]] = []
    with ExitStack() as stack:
        matlab = None if mat is None else stack.enter_context(replacing(mat))
        writer = stack.enter_context(TableWriter(out))
        for table in iter_table(states, CHUNK_ROWS, known=known, doing="solving"):
            columns, derived = solve_table(model, table, load_point, flag, rows, reactions, threads)
            watch.see(derived, np.arange(rows, rows + table.rows) + 1)
            writer.write(columns)
            if matlab is not None:
                kept.append(columns)
            greatest = _greater(greatest, derived, rows)
            rows += table.rows
            unused = list(table.warnings)
            if at_rest(table):
                unused.append(f"{table.source}: {AT_REST}")
        notices = watch.notices()
        if strict:
            refuse(notices)
        if matlab is not None:
            names = kept[0] if kept else {}
            whole = {name: np.concatenate([part[name] for part in kept]) for name in names}
            write_mat(matlab, table_variables(model.mechanism, whole))
    return Solved(rows, [*unused, *(notice.text for notice in notices)], greatest)


def at_rest(table: Table) -> bool:
    """Whether a states file has neither rates nor accelerations."""
    return not any(p + name in table.columns for p in ("d", "dd") for name in COORDINATES)


def _greater(before: Activation | None, derived: Derived, first_row: int) -> Activation | None:
    """The greatest activation so far."""
    size = np.abs(np.where(derived.ok[:, None], derived.activation, np.nan))
    if not np.isfinite(size).any():
        return before
    row, chain = np.unravel_index(np.nanargmax(size), size.shape)
    name = derived.mechanism.chain_names[chain]
    here = Activation(float(size[row, chain]), name, first_row + int(row) + 1)
    return here if before is None or here.value > before.value else before


def solve_table(
    model: Evaluator,
    table: Table,
    load_point: str | None,
    flag: bool,
    first_row: int,
    reactions: bool = False,
    threads: int | None = None,
) -> tuple[dict[str, np.ndarray | list[str]], Derived]:
    """Output columns for the rows of one table, and what follows from its evaluation."""
    names = state_coordinates(model, table)
    q = table.require(names)
    if at_rest(table):
        q1 = q2 = np.zeros_like(q)
    else:
        q1, q2 = (table.require([p + name for name in names]) for p in ("d", "dd"))
    q, q1, q2 = model.independent_states(names, q, q1, q2, threads=threads)
    wrench, point = loads(model, table, load_point)
    evaluation = model.evaluate(q, q1, q2, with_point(wrench, point), threads)
    mechanism = model.mechanism
    derived = Derived(mechanism, evaluation, wrench, model.limited)
    if not flag:
        require_ok(mechanism, evaluation, row_offset=first_row)

    def filled(array: np.ndarray) -> np.ndarray:
        return array if derived.all_ok else np.where(derived.ok[:, None], array, np.nan)

    labels = {
        "chain": mechanism.chain_names,
        "contact": mechanism.contact_names,
        "coordinate": COORDINATES,
    }
    columns: dict[str, np.ndarray | list[str]] = {}
    for variable in VARIABLES:
        if variable.column is not None and variable.when(derived):
            array = variable.values(derived)
            array = np.linalg.norm(array, axis=-1) if variable.sizes else array
            columns |= named_columns(variable.column, labels[variable.dims[1]], filled(array))
    if reactions:
        for name, reaction in joint_reactions(model, evaluation).items():
            array = filled(reaction.array)
            columns |= {f"reaction_{name}_{axis}": array[:, i] for i, axis in enumerate(AXES)}
    columns |= lift_off_columns(mechanism, derived.lifted)
    if flag:
        shortfall = derived.shortfall if derived.limited else None
        columns |= status_columns(mechanism, evaluation.status, derived.cause, shortfall)
    return columns, derived


def loads(model: Evaluator, table: Table, load_point: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Wrenches of a table, (N, 6), zero where it has none, and where they act, (3,)."""
    wrench, point = np.zeros((table.rows, 6)), np.zeros(3)
    given = [name for name in WRENCH if name in table.columns]
    for name in given:
        wrench[:, WRENCH.index(name)] = table.columns[name]
    if load_point is not None or set(given) & set(WRENCH[:3]):
        point = model.load_point(load_point)
    return wrench, point


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
