"""A measured motion as files: the pose, the markers beside it, the load."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from condyle.errors import InputError
from condyle.motion.markers.measured import MarkerMotion
from condyle.motion.table_writer import TableWriter
from condyle.motion.units import FORCE, POSE


def write_motion(
    found: MarkerMotion,
    out: str | os.PathLike[str],
    markers: str | os.PathLike[str] | None = None,
    load: str | os.PathLike[str] | None = None,
) -> list[Path]:
    """Write all files or none; returns their names.

    Args:   out: t, X ... gamma;  markers: t and MARKER_x, MARKER_y, MARKER_z [m] in {S}, empty
            where not seen;  load: t, Fx, Fy, Fz [N] in {S}. CSV, or Parquet by the name's end.
    Raises: InputError: if a file cannot be written, or two are one.
    """
    motion = found.motion
    tables = {out: {"t": motion.t} | dict(zip(POSE, motion.value.T, strict=True))}
    if markers is not None:
        places = {
            f"{name}_{axis}": points[:, i]
            for name, points in found.markers.items()
            for i, axis in enumerate("xyz")
        }
        tables[markers] = {"t": motion.t} | places
    if load is not None:
        if found.load is None:
            raise InputError("load: no channels were named for it")
        force = np.ascontiguousarray(found.load.wrench[:, :3].T)
        tables[load] = {"t": found.load.t} | dict(zip(FORCE, force, strict=True))
    files = [Path(path) for path in (out, markers, load) if path is not None]
    if len({path.resolve() for path in files}) < len(files):
        raise InputError(f"{out}: two files to write have one name")
    with ExitStack() as stack:
        writers = [stack.enter_context(TableWriter(path)) for path in tables]
        for writer, columns in zip(writers, tables.values(), strict=True):
            writer.write(columns)
    return files
