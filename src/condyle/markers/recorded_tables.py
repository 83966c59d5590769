"""Recordings as tables of text: markers of .trc and .csv, channels of .mot, .sto and .csv."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..errors import InputError, join, short
from ..files.atomic import ending_of
from ..files.reading import digest, require_file
from ..motion.column_units import name_and_unit
from ..motion.number_table import AXES, NumberTable
from ..motion.table_heads import NUMBER
from ..motion.table_reader import read_table
from .jts_file import ENDINGS as JTS
from .jts_file import read_jts
from .recording import FASTEST, SLOWEST, Recording, check_unit, read_c3d, unit_of

_UNEVEN, _ROUNDED = 0.02, 0.3  # of a frame, by which times may miss an even grid, as rounded
_LATEST = 1e9  # s
_CLOCK = "t", "time"
_TABLES = ".csv", ".parquet", ".trc"
_SIGNALS = ".csv", ".parquet", ".mot", ".sto"
_Y_UP, _Z_UP = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def read_recording(
    path: str | os.PathLike[str],
    unit: str | None = None,
    channels: str | os.PathLike[str] | None = None,
    *,
    markers: bool = True,
) -> Recording:
    """Read a recording of markers: C3D, TRC, a table (CSV, Parquet), or frames of the Jaw Tracking
    System (HDF5), whose axes stand for markers.

    TRC has the unit of its header, and Y up as OpenSim has it. A table has `t` [s] and
    `<marker>_x`, `_y`, `_z` [m, or as `_x [mm]` says]; its other columns are channels. An empty
    cell is a marker that was not seen.

    Args:   unit: of lengths, in place of what the file says;
            channels: another file (.mot, .sto, a table) with force or EMG channels on the same
            clock, in place of the recording's own;
            markers: it has to hold some; else it may be a file of channels alone.
    Raises: InputError: for other files, and times that are not even.
    """
    check_unit(unit)
    for file in (path, *(() if channels is None else (channels,))):
        require_file(file)
    kinds = (".c3d", *((*_TABLES, *JTS) if markers else _SIGNALS))
    if (kind := ending_of(path, kinds)) in JTS:
        recording = read_jts(path, unit)
    elif kind == ".c3d":
        recording = read_c3d(path, unit, markers=markers)
    else:
        recording = _read_table(path, unit, markers)
    return recording if channels is None else _with_channels(recording, channels)


def _read_table(path: str | os.PathLike[str], unit: str | None, markers: bool) -> Recording:
    table = read_table(path, gaps=markers)
    expected = "t, and <marker>_x, _y, _z" if markers else "a column of times, t or time"
    clock, facts = _clock(table, expected), table.facts  # of .trc alone
    columns = {name: x for name, x in table.columns.items() if name not in (clock, "Frame#")}
    if table.rows < 2:
        raise InputError(f"{path}: holds {table.rows} frames, expected more")
    usual = facts.get("Units", "") if facts else "m"
    labels: tuple[str, ...] = ()
    points, said = np.empty((table.rows, 0, 3)), "m"
    if markers:
        labels, points, said = _markers(table.source, columns, unit, usual)
    unit, metres, assumed = unit_of(path, said, None, "Units" if facts else "of its columns")
    t, step = _evenly(table.source, _times(table, clock), facts.get("DataRate", ""))
    return Recording(
        source=os.path.basename(path),
        sha256=digest(path),
        rate=float(f"{1 / step:.7g}"),
        first_frame=1,
        t=t,
        unit=unit,
        metres=metres,
        labels=labels,
        points=np.where(np.isfinite(points), points, np.nan) * metres,
        channels=tuple(columns),
        channel_units=("",) * len(columns),
        samples=np.array([*columns.values()]).reshape(len(columns), table.rows).T[:, None],
        warnings=(*assumed, *table.warnings, *_miscounts(table, len(labels))),
        up=_Y_UP if facts else _Z_UP,
    )


def _markers(
    source: str, columns: dict[str, np.ndarray], unit: str | None, usual: str
) -> tuple[tuple[str, ...], np.ndarray, str]:
    """Labels, places (F, L, 3) and the unit of markers, whose columns are taken out.

    Args: unit: in place of what columns say;  usual: of columns that say none.
    """
    parts: dict[str, dict[str, str]] = {}
    units = set()
    for name in columns:
        stem, own = name_and_unit(name)
        marker, _, axis = stem.rpartition("_")
        if marker and axis in (*AXES,):
            parts.setdefault(marker, {})[axis] = name
            units.add(unit or own or usual)
    complete = {label: axes for label, axes in parts.items() if len(axes) == 3}
    if not complete:
        raise InputError(f"{source}: has no marker: expected columns <marker>_x, _y and _z")
    if len(units) > 1:
        raise InputError(f"{source}: lengths in {join(sorted(units))}; expected one unit")
    points = np.array([[columns.pop(axes[a]) for a in AXES] for axes in complete.values()])
    return tuple(complete), points.transpose(2, 0, 1), units.pop()


def _miscounts(table: NumberTable, markers: int) -> Iterator[str]:
    """What the head of a .trc file counts otherwise than there is."""
    for key, what, count in (
        ("NumFrames", "frames", table.rows),
        ("NumMarkers", "markers", markers),
    ):
        if (said := table.facts.get(key, str(count))) != str(count):
            yield f"{table.source}: says {short(said)} {what} ({key}) and holds {count}"


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
        f'{table.source}: column "t" is missing; expected {expected}, got {join(table.columns)}'
    )


def _times(table: NumberTable, clock: str) -> np.ndarray:
    t = table.times(clock)
    if (beyond := np.abs(t).max(initial=0.0)) > _LATEST:
        raise InputError(f"{table.source}: a row is at {beyond:.3g}; expected times in s")
    return t


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
