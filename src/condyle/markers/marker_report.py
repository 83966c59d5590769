"""What was found in a recording: in words, as data, and as files."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..motion.column_units import FORCE, MOMENT, POSE
from ..motion.table_writer import TableWriter

if TYPE_CHECKING:
    from .marker_motion import MarkerMotion

_LISTED = 12  # gaps in the text; all are in the data


def in_words(found: MarkerMotion) -> str:
    """Residuals, registration, gaps and distances from the contacts, some lines of text."""
    recording, motion = found.recording, found.motion
    lines = [
        f"{recording.source}: {len(recording.t)} frames at {recording.rate:g} Hz from "
        f"{recording.t[0]:.6g} to {recording.t[-1]:.6g} s, lengths in {recording.unit}",
        f"Motion: {len(motion)} poses from {motion.t[0]:.6g} to {motion.t[-1]:.6g} s, "
        f"{int((~found.measured).sum())} of them filled in",
    ]
    width = max(len(r.name) for r in found.residuals)
    lines.append("Distance of each marker from its place in its body:")
    lines += [
        f"  {r.name:{width}}  {r.body:8}  {_mm(r.rms)} RMS, {_mm(r.largest)} at most "
        f"(at {r.time:.4g} s), seen {100 * r.seen:.4g} % of the time"
        for r in found.residuals
    ]
    if found.registration.residual:
        given = found.registration.residual.items()
        lines.append(
            "Registration, distance of each point from its place in the mechanism: "
            + ", ".join(f"{name} {_mm(value)}" for name, value in given)
        )
    if found.off_contacts:
        given_contacts = found.off_contacts.items()
        lines.append(
            "Contacts will take away: "
            + ", ".join(f"{n} {_mm(rms)} RMS, {_mm(m)} at most" for n, (rms, m) in given_contacts)
        )
    lines += _channels(found)
    lines.append(f"Gaps: {len(found.gaps) or 'none'}")
    lines += [f"  {gap}" for gap in found.gaps[:_LISTED]]
    if len(found.gaps) > _LISTED:
        lines.append(f"  and {len(found.gaps) - _LISTED} more")
    return "\n".join(lines)


def _channels(found: MarkerMotion) -> list[str]:
    """What came of the other channels."""
    lines = []
    if (load := found.load) is not None:
        force, moment = (np.linalg.norm(part, axis=1).max() for part in np.split(load.wrench, 2, 1))
        at = f" at {load.point}" if load.point else ""
        about = f", moment up to {moment:.4g} N m there" if moment else ""
        lines.append(f"Load: force up to {force:.4g} N{at}{about}")
    if emg := found.beside.emg:
        peaks = ", ".join(
            f"{chain} {values.max():.3g} at {found.motion.t[values.argmax()]:.4g} s"
            for chain, values in emg.items()
        )
        lines.append(f"EMG, largest of each: {peaks}")
    return lines


def as_data(found: MarkerMotion) -> dict[str, Any]:
    """The same in SI, as JSON has it."""
    recording = found.recording
    return {
        "frames": len(recording.t),
        "rate": recording.rate,
        "first_frame": recording.first_frame,
        "unit": recording.unit,
        "poses": len(found.motion),
        "residuals": [vars(r) for r in found.residuals],
        "registration": found.registration.residual,
        "off_contacts": {
            name: {"rms": rms, "largest": largest}
            for name, (rms, largest) in found.off_contacts.items()
        },
        "gaps": [vars(gap) for gap in found.gaps],
        "load": None
        if found.load is None
        else {"point": found.load.point, "largest": np.abs(found.load.wrench).max(axis=0).tolist()},
        "emg": {chain: float(values.max()) for chain, values in found.beside.emg.items()},
        "warnings": list(found.warnings),
    }


def _mm(metres: float) -> str:
    return f"{metres * 1e3:.3g} mm"


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
