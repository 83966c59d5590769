"""Recordings as tables of text: markers of .trc and .csv, channels of .mot, .sto and .csv."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError, as_path, few
from ..motion.column_units import LENGTH_UNITS, name_and_unit
from ..motion.csv_file import NUMBER
from ..motion.file_words import content_of, digest, short
from ..motion.number_table import AXES, NumberTable
from ..motion.table_reader import read_table
from .recording import FASTEST, SLOWEST, Recording, check_unit, read_c3d, unit_of

_UNEVEN, _ROUNDED = 0.02, 0.3  # of a frame, by which times may miss an even grid, as rounded
_LATEST = 1e9  # s
_CLOCK = "t", "time"
_SEPARATORS = "\t", ";", ",", None  # None: spaces
_Y_UP, _Z_UP = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def read_recording(
    path: str | os.PathLike[str],
    unit: str | None = None,
    channels: str | os.PathLike[str] | None = None,
) -> Recording:
    """Read a recording of markers: C3D, TRC, or a table (CSV, Parquet).

    TRC has the unit of its header, and Y up as OpenSim has it. A table has `t` [s] and
    `<marker>_x`, `_y`, `_z` [m, or as `_x [mm]` says]; its other columns are channels. An empty
    cell is a marker that was not seen.

    Args:   unit: of lengths, in place of what the file says;
            channels: another file (.mot, .sto, a table) with force or EMG channels on the same
            clock, in place of the recording's own.
    Raises: InputError: for other files, and times that are not even.
    """
    check_unit(unit)
    kind = Path(as_path(path)).suffix.lower()
    if kind == ".c3d":
        found = read_c3d(path, unit)
    elif kind in _READERS:
        found = _READERS[kind](path, unit)
    else:
        known = few(sorted([".c3d", *_READERS]))
        raise InputError(f'{path}: expected a recording that ends in {known}, got "{short(kind)}"')
    return found if channels is None else _with_channels(found, channels)


def _read_trc(path: str | os.PathLike[str], unit: str | None) -> Recording:
    text = _text(path)
    lines = text.splitlines()
    if len(lines) < 6 or not lines[0].startswith("PathFileType"):
        raise InputError(f"{path}: is no TRC file: its first line does not begin PathFileType")
    split = _separator(lines[3])
    names = _cells(lines[3].rstrip("\t,; \r"), split)
    # Above X, Y, Z of a marker stand its name and two empty cells; words have no empty ones.
    labels, rest = (names[2:], []) if split is None else (names[2::3], names[3::3] + names[4::3])
    if not labels or not all(labels) or any(rest):
        raise InputError(
            f"{path}, line 4: expected Frame#, Time, and the name of each marker above its X"
        )
    table, points, notes = _trc_rows(path, lines, len(labels), whole=text.endswith(("\n", "\r")))
    keys, values = (_cells(line, _separator(line)) for line in lines[1:3])
    if len(values) > len(keys):  # some programs put two tabs between them
        values = [value for value in values if value]
    head = dict(zip(keys, values, strict=False))
    for key, what, count in (
        ("NumFrames", "frames", len(points)),
        ("NumMarkers", "markers", len(labels)),
    ):
        if head.get(key, str(count)) != str(count):
            notes.append(f"says {short(head[key])} {what} ({key}) and holds {count}")
    named, _, assumed = unit_of(path, head.get("Units", ""), unit, "Units")
    return _recording(
        table,
        "Time",
        labels,
        points.reshape(len(points), len(labels), 3),
        named,
        up=_Y_UP,
        warnings=(*assumed, *(f"{path}: {note}" for note in notes)),
        rate=head.get("DataRate", ""),
    )


def _trc_rows(
    path: str | os.PathLike[str], lines: Sequence[str], markers: int, whole: bool
) -> tuple[NumberTable, np.ndarray, list[str]]:
    """Times below five lines, coordinates, (F, 3 L), and what was read otherwise than it stands.

    Cells that are missing at a row's end are markers that were not seen, as of programs that write
    no empty cells; the file's last row is cut short then, and left out, unless its line ends.
    """
    rows = [(n, line) for n, line in enumerate(lines[5:], 6) if line.strip()]
    width = 2 + 3 * markers
    fitting = (s for _, line in rows[:99] for s in _SEPARATORS if _fits(_cells(line, s), width))
    split = next(fitting, _separator(rows[0][1]) if rows else None)
    found, numbers, unseen, notes = [], [], [], list[str]()
    for number, line in rows:
        cells = _cells(line, split)
        missing = width - len(cells)
        if missing > 0 and number == rows[-1][0] and (missing % 3 or not whole):
            notes.append(
                f"its last row (line {number}) is cut short, {len(cells)} cells of {width}, and "
                "left out; if that is not all, copy or export it again"
            )
            break
        if missing > 0 and missing % 3 == 0 and len(cells) > 2:
            unseen.append(number)
            cells += [""] * missing
        found.append(_numbers(path, number, cells, width, split))
        numbers.append(number)
    if unseen:
        notes.append(
            f"{len(unseen)} of its rows, the first on line {unseen[0]}, end before {width} cells; "
            "markers without cells count as not seen there"
        )
    values = np.reshape(found, (len(found), width))
    return NumberTable(str(path), {"Time": values[:, 1]}, np.array(numbers)), values[:, 2:], notes


def _read_table(path: str | os.PathLike[str], unit: str | None) -> Recording:
    table = read_table(path, gaps=True)
    clock = _clock(table, "t, and <marker>_x, _y, _z")
    columns = {name: column for name, column in table.columns.items() if name != clock}
    parts: dict[str, dict[str, str]] = {}
    units = set()
    for name in columns:
        stem, own = name_and_unit(name)
        marker, _, axis = stem.rpartition("_")
        if marker and axis in (*AXES,):
            parts.setdefault(marker, {})[axis] = name
            units.add(unit or own or "m")
    whole = {label: axes for label, axes in parts.items() if len(axes) == 3}
    if not whole:
        raise InputError(f"{path}: has no marker: expected columns <marker>_x, _y and _z")
    if len(units) > 1:
        raise InputError(f"{path}: lengths in {few(sorted(units))}; expected one unit")
    points = np.array([[columns.pop(axes[a]) for a in AXES] for axes in whole.values()])
    named, *_ = unit_of(path, units.pop(), None, "of its columns")
    found = _recording(table, clock, list(whole), points.transpose(2, 0, 1), named)
    samples = np.array([*columns.values()]).reshape(len(columns), table.rows).T[:, None]
    return replace(
        found, channels=tuple(columns), channel_units=("",) * len(columns), samples=samples
    )


_READERS: dict[str, Callable[[str | os.PathLike[str], str | None], Recording]] = {
    ".trc": _read_trc,
    ".csv": _read_table,
    ".parquet": _read_table,
}


def _with_channels(recording: Recording, path: str | os.PathLike[str]) -> Recording:
    """The recording with the channels of another file, as many samples a frame as that has."""
    table = read_table(path)
    clock = _clock(table, "a column of times, t or time")
    t = _times(table, clock)
    if (
        t[0] > recording.t[0] + 0.5 / recording.rate
        or t[-1] < recording.t[-1] - 0.5 / recording.rate
    ):
        raise InputError(
            f"{path}: runs from {t[0]:.6g} to {t[-1]:.6g} s, and {recording.source} from "
            f"{recording.t[0]:.6g} to {recording.t[-1]:.6g} s; expected channels for all of it"
        )
    each = max(round((len(t) - 1) / max(t[-1] - t[0], 1e-9) / recording.rate), 1)
    at = recording.t[:, None] + np.arange(each) / (each * recording.rate)
    columns = {name: np.interp(at, t, x) for name, x in table.columns.items() if name != clock}
    return replace(
        recording,
        channels=tuple(columns),
        channel_units=("",) * len(columns),
        samples=np.stack([*columns.values()], axis=-1),
        plates=(),
    )


def _clock(table: NumberTable, expected: str) -> str:
    """The column of times."""
    for name in table.columns:
        if name.casefold() in _CLOCK:
            return name
    raise InputError(
        f'{table.source}: column "t" is missing; expected {expected}, got {few(table.columns)}'
    )


def _times(table: NumberTable, clock: str) -> np.ndarray:
    t = table.times(clock)
    if (beyond := np.abs(t).max(initial=0.0)) > _LATEST:
        raise InputError(f"{table.source}: a row is at {beyond:.3g}; expected times in s")
    return t


def _recording(
    table: NumberTable,
    clock: str,
    labels: Sequence[str],
    points: np.ndarray,
    unit: str,
    up: tuple[float, float, float] = _Z_UP,
    warnings: tuple[str, ...] = (),
    rate: str = "",
) -> Recording:
    """Args: rate: frames a second, as the file says it."""
    path = table.source
    if table.rows < 2:
        raise InputError(f"{path}: holds {table.rows} frames, expected more")
    t, step = _evenly(path, _times(table, clock), rate)
    metres = LENGTH_UNITS[unit]
    return Recording(
        source=os.path.basename(path),
        sha256=digest(path),
        rate=float(f"{1 / step:.7g}"),
        first_frame=1,
        t=t,
        unit=unit,
        metres=metres,
        labels=tuple(labels),
        points=np.where(np.isfinite(points), points, np.nan) * metres,
        channels=(),
        channel_units=(),
        samples=np.empty((len(t), 1, 0)),
        warnings=warnings,
        up=up,
    )


def _evenly(path: str, t: np.ndarray, rate: str) -> tuple[np.ndarray, float]:
    """Times at one rate, (F,) [s], and their step; written ones may be rounded, to 1 ms say."""
    count = np.arange(len(t))
    step = float(t[-1] / count[-1] - t[0] / count[-1])
    if not 1 / FASTEST <= step <= 1 / SLOWEST:
        raise InputError(
            f"{path}: frames from {t[0]:.6g} to {t[-1]:.6g}, each {step:.3g} after the one before; "
            "expected times in s"
        )
    rounding = next((0.5 * 10.0**-d for d in range(7) if np.abs(t - t.round(d)).max() < 1e-9), 0.0)
    said = float(rate) if NUMBER.fullmatch(rate) else 0.0
    if SLOWEST <= said <= FASTEST and abs(count[-1] * (step - 1 / said)) <= 2 * rounding:
        step = 1 / said
    off = np.abs(t - t[0] - step * count).max()
    if off > max(_UNEVEN * step, min(2.01 * rounding, _ROUNDED * step)):
        raise InputError(f"{path}: its times are not even; expected frames at one rate")
    return (t if off < 1e-6 * step else t[0] + step * count), step


def _text(path: str | os.PathLike[str]) -> str:
    try:
        return content_of(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: is no text (UTF-8 expected)") from None


def _separator(line: str) -> str | None:
    """What stands between the cells of a line; None: spaces."""
    return next((s for s in _SEPARATORS if s and s in line), None)


def _cells(line: str, separator: str | None) -> list[str]:
    return [cell.strip() for cell in line.split(separator)]


def _fits(cells: Sequence[str], width: int) -> bool:
    return len(cells) >= width and not any(cells[width:])


def _numbers(
    path: str | os.PathLike[str], line: int, cells: list[str], width: int, separator: str | None
) -> list[float]:
    """Numbers of a row, with a decimal point, or a decimal comma; an empty cell is NaN."""
    if not _fits(cells, width):
        raise InputError(f"{path}, line {line}: {len(cells)} cells, expected {width}")
    if separator != "," and not any("." in cell for cell in cells):
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        return [float(cell) if cell else np.nan for cell in cells[:width]]
    except ValueError as error:
        raise InputError(f"{path}, line {line}: {short(str(error))}") from None
