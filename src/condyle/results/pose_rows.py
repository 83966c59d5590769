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
from ..mechanism.mechanism import COORDINATES
from ..model.forward_kinematics import TOLERANCE, ForwardKinematics, PoseStatus
from ..model.model_result import ModelResult
from ..model.system import check_home
from ..motion import NumberTable
from ..motion.column_units import Dimension
from ..progress import step
from ..quantities import QUANTITIES, named_columns
from ..quantities.entries import chain_units
from .row_stream import Columns, StatesReport, row_stream

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
    check_home(mechanism)
    forward, units = ForwardKinematics(mechanism), np.array(chain_units(mechanism, "joint"))
    names = QUANTITIES["joint"].dimensions(mechanism)
    known: dict[str, Dimension] = {"t": ("time", 0), **names}
    with row_stream(joints, out, known, max_error=max_error, in_chunks=False) as rows:
        for table in rows:
            given, time = table.require(names), table.columns.get("t")
            if every:
                columns, data, text = _modes(forward, given, time, units, seed or 0, tolerance)
                rows.write(columns)
                continue
            with step("finding poses"):
                result = forward.solve(given, time, tolerance)
            if not flag:
                _require_poses(result, table, units, tolerance)
            residual = np.where(result.status[:, None] == PoseStatus.OK, result.residual, np.nan)
            columns = {} if time is None else {"t": time}
            columns |= named_columns("", COORDINATES, result.pose) | _largest(residual, units)
            columns |= {"condition": result.condition, "bound": result.bound}
            if flag:
                columns["status"] = [PoseStatus(value).name.lower() for value in result.status]
            rows.write(columns, result.bound)
            data, text = _summary(result, units)
    return StatesReport({"rows": rows.count, **data, "files": rows.files}, text)


def _require_poses(
    result: ModelResult, table: NumberTable, units: np.ndarray, tolerance: float
) -> None:
    """Raises SampleError for rows without a pose: why the first of them has none."""
    missing = np.flatnonzero(result.status)
    if not missing.size:
        return
    row = int(missing[0])
    error, text = ERRORS[PoseStatus(result.status[row])]
    joint = int(np.argmax(np.abs(np.nan_to_num(result.residual[row]))))
    text = text.format(
        row=row + 1,
        start="the row before" if "t" in table.columns and row else "home",
        residual=abs(result.residual[row, joint]),
        unit=units[joint],
        tolerance=tolerance,
    )
    more = f" ({missing.size - 1} more rows have no pose)" if missing.size > 1 else ""
    text = f"{table.source}: {text}. --flag keeps such rows, empty{more}"
    raise error(text, missing.tolist())


def _summary(result: ModelResult, units: np.ndarray) -> tuple[dict[str, Any], str]:
    """What a report says of the poses of all rows, and in words."""
    status, ok = result.status, result.status == PoseStatus.OK
    counts = {one.name.lower(): int((status == one).sum()) for one in PoseStatus if one}
    failed = {name: count for name, count in counts.items() if count}
    text = f"{ok.sum()} of {ok.size} poses found"
    if failed:
        text += f" ({', '.join(f'{count} {name}' for name, count in failed.items())})"
    largest, condition = {}, float("nan")
    if ok.any():
        size = np.abs(result.residual[ok])
        largest = {str(unit): float(size[:, units == unit].max()) for unit in np.unique(units)}
        condition = float(np.nanmax(result.condition))
        texts = ", ".join(f"{value:.3g} {unit}" for unit, value in largest.items())
        text += f"; largest joint residual {texts}, largest condition number {condition:.4g}"
    missing = int((~ok).sum())
    data = {"missing": missing, "failed": failed, "residual": largest, "condition": condition}
    return data, text


def _modes(
    forward: ForwardKinematics,
    given: np.ndarray,
    time: np.ndarray | None,
    units: np.ndarray,
    seed: int,
    tolerance: float,
) -> tuple[Columns, dict[str, Any], str]:
    """The assembly modes that a seeded search finds for every row, and what a report says."""
    modes = []
    with step("looking for assembly modes", len(given)) as advance:
        for joints in given:
            modes.append(forward.modes(joints, seed, tolerance))
            advance(1)
    counts = [len(one.pose) for one in modes]
    result = {name: np.concatenate([vars(one)[name] for one in modes]) for name in vars(modes[0])}
    columns: Columns = {"row": np.repeat(np.arange(len(given)), counts) + 1}
    columns |= {} if time is None else {"t": np.repeat(time, counts)}
    columns["mode"] = np.concatenate([np.arange(count) + 1 for count in counts])
    columns |= named_columns("", COORDINATES, result["pose"])
    columns["distance"] = result["distance"]
    columns |= _largest(result["residual"], units)
    columns["condition"] = result["condition"]
    least, most = min(counts), max(counts)
    count = str(least) if least == most else f"{least} to {most}"
    kind = "assembly mode" if most == 1 else "assembly modes"
    rows = "1 row" if len(given) == 1 else f"{len(given)} rows"
    return columns, {"modes": counts}, f"{count} {kind} found for {rows}; the search may miss some"


def _largest(residual: np.ndarray, units: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of the largest residual of each row, one for each unit."""
    kinds = np.unique(units)
    largest = {unit: np.abs(residual[:, units == unit]).max(axis=1) for unit in kinds}
    return {"residual" if len(kinds) == 1 else f"residual_{u}": a for u, a in largest.items()}
