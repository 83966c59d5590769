"""A measured motion as files: the pose, what was measured beside it, the load."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path

from ..errors import InputError
from ..motion.table_writer import TableWriter
from ..motion.units import FORCE, MOMENT, POSE
from .measured import MarkerMotion


def write_motion(
    found: MarkerMotion,
    out: str | os.PathLike[str],
    measured: str | os.PathLike[str] | None = None,
    load: str | os.PathLike[str] | None = None,
) -> list[Path]:
    """Write all files or none; returns their names.

    Args:   out: t, X ... gamma;  measured: the columns of `Beside`, empty where nothing was seen;
            load: t, Fx, Fy, Fz [N] and, of a plate, Mx, My, Mz [N m] in {S}. CSV, or Parquet by the
            name's end.
    Raises: InputError: if a file cannot be written, or two are one.
    """
    motion = found.motion
    tables = {out: {"t": motion.t} | dict(zip(POSE, motion.value.T, strict=True))}
    if measured is not None:
        tables[measured] = found.beside.columns()
    if load is not None:
        if found.load is None:
            raise InputError(
                "load: no channels were named for it; name them in [forces] of the marker file"
            )
        wrench = found.load.wrench
        given = wrench if wrench[:, 3:].any() else wrench[:, :3]
        names = (*FORCE, *MOMENT)[: given.shape[1]]
        tables[load] = {"t": found.load.t} | dict(zip(names, given.T.copy(), strict=True))
    files = [Path(path) for path in (out, measured, load) if path is not None]
    if len({path.resolve() for path in files}) < len(files):
        raise InputError(f"{out}: two files to write have one name")
    with ExitStack() as stack:
        writers = [stack.enter_context(TableWriter(path)) for path in tables]
        for writer, columns in zip(writers, tables.values(), strict=True):
            writer.write(columns)
    return files
