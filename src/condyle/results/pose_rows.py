"""Joint coordinates, one sample a row: a file in, poses out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import (
    InconsistentError,
    LostError,
    SampleError,
    UnreachableError,
    UnsupportedError,
    as_flag,
)
from ..mechanism.files import as_mechanism
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..model.forward_kinematics import TOLERANCE, ForwardKinematics, PoseStatus
from ..model.system import check_home
from ..motion import NumberTable, read_table, write_table
from ..progress import step
from ..quantities import QUANTITIES
from ..quantities.entries import chain_units
from .accuracy import max_error_of, require_accuracy
from .state_rows import StatesReport

ERRORS: dict[PoseStatus, tuple[type[SampleError], str]] = {
    PoseStatus.UNREACHABLE: (
        UnreachableError,
        "no pose has the joint coordinates of row {row}, or none that is reached from {start} "
        "without passing a singularity. Check units and zero positions (`zero` of actuators); "
        "--all looks for poses anywhere",
    ),
    PoseStatus.LOST: (
        LostError,
        "from row {row} on it is not certain to which assembly mode the joint coordinates belong: "
        "next to a singularity two modes meet, and what came before points to another one than "
        "the joints lead to. Sample more densely, or cut the file there; --all lists the modes",
    ),
    PoseStatus.INCONSISTENT: (
        InconsistentError,
        "no pose near the one found has the joint coordinates of row {row}: they differ by up to "
        "{residual:.3g} {unit}, more than the tolerance of {tolerance:g}. Encoders may disagree: "
        "check zero positions and geometry, or raise --tolerance to their error. Or the row is so "
        "far from {start} that the way to its pose ended early: give all rows between and a "
        "column t, or look for poses anywhere with --all",
    ),
}


def pose_states(
    mechanism: Any,
    joints: str | Path,
    out: str | Path,
    flag: bool = False,
    tolerance: float = TOLERANCE,
    every: bool = False,
    seed: int | None = None,
    max_error: float | None = None,
) -> StatesReport:
    """Forward kinematics of every row of a file of joint coordinates.

    Args:   mechanism: one, a model, the path of a file, or the name of a bundled one.
            joints: CSV with the columns joint_<chain> [rad or m], readings of encoders;
                    optionally t [s]: then each row follows the one before, else from home.
            out:    CSV: t if given, X ... gamma, residual (largest of the row, in the unit of the
                    joints; where chains slide and turn, residual_m and residual_rad) and
                    condition; with `flag` also status.
            flag:   keep rows for which no pose is found, empty, with a status.
            tolerance: largest residual of a joint [rad or m].
            every:  all assembly modes that a search finds, one a row: row (of `joints`, from 1), t
                    if given, mode (from 1, the nearest to home first), X ... gamma, distance (from
                    home: characteristic lengths and rad), residual and condition. Rows never
                    influence each other.
            seed:   of that search; 0 if not given.
            max_error: largest bound of the poses' error that is accepted, in characteristic lengths
                    and rad; with it there is a column bound.
    Returns: a summary; `data`: rows, missing (rows without a pose), failed (the same by status),
            residual (largest difference of a joint from the given one, by unit), condition (largest
            number of the dimensionless actuator Jacobian); with `every` rows and modes (of each).
    Raises: UnreachableError, LostError, InconsistentError: for such a row without `flag`; nothing
            is written then.
    """
    mechanism, every, flag = as_mechanism(mechanism), as_flag(every, "every"), as_flag(flag, "flag")
    if every and flag:
        raise UnsupportedError(
            "--all and --flag exclude each other: --all lists every pose of a row, if any"
        )
    if seed is not None and not every:
        raise UnsupportedError("--seed requires --all")
    if every and max_error is not None:
        raise UnsupportedError("--max-error is of the pose that is followed, not of --all")
    max_error = max_error_of(max_error)
    if every:
        return _modes(mechanism, joints, out, seed or 0, tolerance)
    table, given = _read(mechanism, joints)
    time = table.columns.get("t")
    with step("finding poses"):
        solution = ForwardKinematics(mechanism).solve(given, time, tolerance)
    status, found = solution.status, solution.status == PoseStatus.OK
    units = _units(mechanism)
    missing = np.flatnonzero(~found)
    if missing.size and not flag:
        row = int(missing[0])
        error, text = ERRORS[PoseStatus(status[row])]
        worst_joint = int(np.argmax(np.abs(np.nan_to_num(solution.residual[row]))))
        text = text.format(
            row=row + 1,
            start="home" if time is None or not row else "the row before",
            residual=abs(solution.residual[row, worst_joint]),
            unit=units[worst_joint],
            tolerance=tolerance,
        )
        more = f" ({missing.size - 1} more rows have no pose)" if missing.size > 1 else ""
        raise error(f"{joints}: {text}. --flag keeps such rows, empty{more}", missing.tolist())
    residual = np.where(found[:, None], solution.residual, np.nan)
    columns: dict[str, np.ndarray | list[str]] = {} if time is None else {"t": time}
    columns |= {name: solution.pose[:, i] for i, name in enumerate(COORDINATES)}
    columns |= (worst := _largest(residual, units))
    columns["condition"] = solution.condition
    if max_error is not None:
        require_accuracy(solution.bound, max_error)
        columns["bound"] = solution.bound
    if flag:
        columns["status"] = [PoseStatus(value).name.lower() for value in status]
    write_table(out, columns)
    counts = {one.name.lower(): int((status == one).sum()) for one in PoseStatus if one}
    failed = {name: count for name, count in counts.items() if count}
    said = f"{int(found.sum())} of {table.rows} poses found"
    if failed:
        said += f" ({', '.join(f'{count} {name}' for name, count in failed.items())})"
    largest, condition = {}, float("nan")
    if found.any():
        each = zip(np.unique(units), worst.values(), strict=True)
        largest = {str(unit): float(np.nanmax(column)) for unit, column in each}
        condition = float(np.nanmax(solution.condition))
        texts = ", ".join(f"{value:.3g} {unit}" for unit, value in largest.items())
        said += f"; largest joint residual {texts}, largest condition number {condition:.4g}"
    data = {"rows": table.rows, "missing": int(missing.size), "failed": failed}
    data |= {"residual": largest, "condition": condition, "files": [Path(out)]}
    return StatesReport(data, said)


def _modes(
    mechanism: Mechanism, joints: str | Path, out: str | Path, seed: int, tolerance: float
) -> StatesReport:
    """The assembly modes that a seeded search finds for every row."""
    table, given = _read(mechanism, joints)
    forward, units = ForwardKinematics(mechanism), _units(mechanism)
    found = []
    with step("looking for assembly modes", table.rows) as advance:
        for row in given:
            found.append(forward.modes(row, seed, tolerance))
            advance(1)
    counts = [len(modes.pose) for modes in found]
    pose = np.concatenate([modes.pose for modes in found])
    columns: dict[str, np.ndarray] = {"row": np.repeat(np.arange(table.rows), counts) + 1}
    if "t" in table.columns:
        columns["t"] = np.repeat(table.columns["t"], counts)
    columns["mode"] = np.concatenate([np.arange(count) + 1 for count in counts])
    columns |= {name: pose[:, i] for i, name in enumerate(COORDINATES)}
    columns["distance"] = np.concatenate([modes.distance for modes in found])
    columns |= _largest(np.concatenate([modes.residual for modes in found]), units)
    columns["condition"] = np.concatenate([modes.condition for modes in found])
    write_table(out, columns)
    few, many = min(counts), max(counts)
    each = str(few) if few == many else f"{few} to {many}"
    rows = "1 row" if table.rows == 1 else f"{table.rows} rows"
    modes = "assembly mode" if many == 1 else "assembly modes"
    said = f"{each} {modes} found for {rows}; the search may miss some"
    return StatesReport({"rows": table.rows, "modes": counts, "files": [Path(out)]}, said)


def _read(mechanism: Mechanism, joints: str | Path) -> tuple[NumberTable, np.ndarray]:
    check_home(mechanism)
    known = QUANTITIES["joint"].dimensions(mechanism)
    table = read_table(joints, known={"t": ("time", 0), **known})
    return table, table.require([*known])


def _units(mechanism: Mechanism) -> np.ndarray:
    return np.array(chain_units(mechanism, "joint"))


def _largest(residual: np.ndarray, units: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of the largest residual of each row, one for each unit."""
    kinds = np.unique(units)
    return {
        "residual" if len(kinds) == 1 else f"residual_{unit}": np.abs(
            residual[:, units == unit]
        ).max(axis=1)
        for unit in kinds
    }
