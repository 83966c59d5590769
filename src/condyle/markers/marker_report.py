"""What was found in a recording: in words, as data, and as files."""

from __future__ import annotations

import math
import os
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..mechanism.mechanism import Mechanism
from ..mechanism.vocabulary import words_of
from ..motion.column_units import FORCE, MOMENT
from ..motion.nearest_pose import NearestPoses
from ..motion.path import Motion
from ..motion.platform_load import Load
from ..motion.table_writer import TableWriter
from .marker_gaps import Gap
from .measured_channels import MeasuredChannels
from .recording import Recording
from .registration import Registration
from .vertical import BaseMotion

_LISTED = 12  # gaps in the text; all are in the data


@dataclass(frozen=True)
class MarkerResidual:
    """Residual of a marker in its body: distances from its mean position in it.

    Attributes: name, body;  seen: part of the frames used, 0 to 1;  rms, largest: [m];
                time: of the largest [s].
    """

    name: str
    body: str
    seen: float
    rms: float
    largest: float
    time: float


@dataclass(frozen=True, eq=False)
class MarkerMotion:
    """A motion from markers, and their residuals.

    Attributes:
        mechanism: whose motion it is.
        motion: X_EE in {S}, of kind "pose", without gaps: on the contacts, the nearest to the
            platform's markers.
        measured: (N,), where it was measured; elsewhere a gap was filled.
        free: the poses that fit the markers without the contacts, smoothed alike, (N, 6).
        residuals: of every marker, over the frames that were used.
        gaps: filled or cut off, in their order.
        registration: from the laboratory to {S}.
        off_contacts: distance of each ball from its surface before that, root mean square and
            largest [m].
        fitted: the poses on the contacts, frame by frame of the recording, and the distances of the
            markers;
        markers_moved: their root mean squares and largest [m], by marker and of "all": `before` the
            contacts and `after`, and how far these have `moved` them.
        home_places: body -> marker -> its place at home in {S}, (3,) [m].
        static: the static trial, where there is one: its `source`, how far the head is from where
            it stood there at most (`head_moved` [m], `head_turned` [rad]), and, if the recording
            has a home too, how far the platform is there (`platform_moved` [m]).
        vertical: gravity and the base's motion, which `motion` has too.
        channels: what was measured with it, at its times: markers in {S} with the base's motion
            taken out, their residuals, and EMG, where the marker file names channels.
        load: from force channels or a force plate, where some were named.
        recording: content of the file.
        warnings: implausible values, and assumptions.
    """

    mechanism: Mechanism
    motion: Motion
    measured: np.ndarray
    free: np.ndarray
    residuals: tuple[MarkerResidual, ...]
    gaps: tuple[Gap, ...]
    registration: Registration
    off_contacts: dict[str, tuple[float, float]]
    fitted: NearestPoses
    markers_moved: dict[str, dict[str, float]]
    home_places: dict[str, dict[str, np.ndarray]]
    static: dict[str, Any] | None
    vertical: BaseMotion
    channels: MeasuredChannels
    load: Load | None
    recording: Recording
    warnings: tuple[str, ...]

    @property
    def markers(self) -> dict[str, np.ndarray]:
        """The markers used, by name, in {S}, (N, 3) [m]; NaN where not seen."""
        return dict(zip(self.channels.names, self.channels.points.transpose(1, 0, 2), strict=True))

    def __str__(self) -> str:
        """Residuals, registration, gaps and distances from the contacts, some lines of text in the
        words of the mechanism."""
        recording, motion, say = self.recording, self.motion, words_of(self.mechanism)
        lines = [
            f"{recording.source}: {len(recording.t)} frames at {recording.rate:g} Hz from "
            f"{recording.t[0]:.6g} to {recording.t[-1]:.6g} s, lengths in {recording.unit}",
            f"Motion: {len(motion)} poses from {motion.t[0]:.6g} to {motion.t[-1]:.6g} s, "
            f"{int((~self.measured).sum())} of them filled in",
        ]
        width = max(len(r.name) for r in self.residuals)
        lines.append("Distance of each marker from its place in its body:")
        lines += [
            f"  {r.name:{width}}  {say(r.body):8}  {_mm(r.rms)} RMS, {_mm(r.largest)} at most "
            f"(at {r.time:.4g} s), seen {100 * r.seen:.4g} % of the time"
            for r in self.residuals
        ]
        if given := self.registration.residual:
            points = ", ".join(f"{name} {_mm(value)}" for name, value in given.items())
            lines.append(
                f"Registration, distance of each point from its place in the mechanism: {points}"
            )
            sized = ", ".join(_mm(value) for value in self.registration.sized.values())
            lines.append(f"  the same in the size that fits best: {sized}")
        if self.static is None and (typed := self.registration.typed):
            lines.append(
                f"  {', '.join(typed)} given as numbers: they hold where the head is at home in "
                "this recording. If they are from another one, name it as the static trial (static)"
            )
        if (held := self.static) is not None:
            closed = held.get("platform_moved", math.nan)
            home = "" if math.isnan(closed) else say(f"; the platform at home {_mm(closed)}")
            lines.append(
                f"From the static trial {held['source']} the head is at most "
                f"{_mm(held['head_moved'])} and {np.degrees(held['head_turned']):.3g} "
                f"degrees{home}"
            )
        lines += [*self._contacts(), str(self.vertical)]
        if (load := self.load) is not None:
            force, moment = (
                np.linalg.norm(part, axis=1).max() for part in np.split(load.wrench, 2, 1)
            )
            at = f" at {load.point}" if load.point else ""
            about = f", moment up to {moment:.4g} N m there" if moment else ""
            lines.append(f"Load: force up to {force:.4g} N{at}{about}")
        if emg := self.channels.emg.items():
            peaks = [f"{n} {v.max():.3g} at {motion.t[v.argmax()]:.4g} s" for n, v in emg]
            lines.append(f"EMG, largest of each: {', '.join(peaks)}")
        lines.append(f"Gaps: {len(self.gaps) or 'none'}")
        lines += [f"  {gap}" for gap in self.gaps[:_LISTED]]
        if len(self.gaps) > _LISTED:
            lines.append(f"  and {len(self.gaps) - _LISTED} more")
        return "\n".join(lines)

    def _contacts(self) -> list[str]:
        """How far the contacts are from the measured poses, and what they change of the markers."""
        if not self.off_contacts:
            return []
        say = words_of(self.mechanism)
        balls = ", ".join(
            f"{n} {_mm(rms)} RMS, {_mm(m)} at most" for n, (rms, m) in self.off_contacts.items()
        )
        lines = [
            f"{say('Contacts, distance of the measured poses')}: {balls}",
            say(
                "Distance of each marker on the platform from its place, before the contacts and "
                "on them:"
            ),
        ]
        width = max(map(len, self.markers_moved))
        lines += [
            f"  {name:{width}}  {_mm(d['before_rms'])} RMS, {_mm(d['before_largest'])} at most; "
            f"{_mm(d['after_rms'])} RMS, {_mm(d['after_largest'])} at most"
            for name, d in self.markers_moved.items()
            if d
        ]
        every = self.markers_moved["all"]
        lines.append(
            f"{say('Contacts move the markers')} by {_mm(every['moved_rms'])} RMS, "
            f"{_mm(every['moved_largest'])} at most"
        )
        return lines


def as_data(converted: MarkerMotion) -> dict[str, Any]:
    """The same in SI, as JSON has it."""
    recording, load = converted.recording, converted.load
    return {
        "frames": len(recording.t),
        "rate": recording.rate,
        "first_frame": recording.first_frame,
        "unit": recording.unit,
        "poses": len(converted.motion),
        "residuals": [vars(r) for r in converted.residuals],
        "registration": converted.registration.residual,
        "off_contacts": {
            n: {"rms": rms, "largest": most} for n, (rms, most) in converted.off_contacts.items()
        },
        "static": converted.static,
        "markers_moved": converted.markers_moved,
        "vertical": converted.vertical.data(),
        "gaps": [vars(gap) for gap in converted.gaps],
        "load": load and {"point": load.point, "largest": np.abs(load.wrench).max(axis=0).tolist()},
        "emg": {chain: float(values.max()) for chain, values in converted.channels.emg.items()},
        "warnings": list(converted.warnings),
    }


def _mm(metres: float) -> str:
    return f"{metres * 1e3:.3g} mm"


def write_motion(
    converted: MarkerMotion,
    out: str | os.PathLike[str],
    measured: str | os.PathLike[str] | None = None,
    load: str | os.PathLike[str] | None = None,
) -> list[Path]:
    """Write all files or none; returns their names.

    Args:   out: t, X ... gamma, gravity (gx, gy, gz) and the base's motion (base_ax ...);
            measured: the columns of `MeasuredChannels`, empty where nothing was seen;
            load: t, Fx, Fy, Fz [N] and, of a plate, Mx, My, Mz [N m] in {S}.
            A name ends in .csv or .parquet.
    Raises: InputError: if a file cannot be written, or two are one.
    """
    motion = converted.motion
    tables = {out: motion.columns}
    if measured is not None:
        tables[measured] = converted.channels.columns()
    if load is not None:
        if converted.load is None:
            raise InputError(
                "load: no channels were named for it; name them in [forces] of the marker file"
            )
        wrench = converted.load.wrench
        given = wrench if wrench[:, 3:].any() else wrench[:, :3]
        names = (*FORCE, *MOMENT)[: given.shape[1]]
        tables[load] = {"t": converted.load.t} | dict(zip(names, given.T.copy(), strict=True))
    files = [Path(path) for path in (out, measured, load) if path is not None]
    if len({path.resolve() for path in files}) < len(files):
        raise InputError(f"{out}: two files to write have one name")
    with ExitStack() as stack:
        writers = [stack.enter_context(TableWriter(path)) for path in tables]
        for writer, columns in zip(writers, tables.values(), strict=True):
            writer.write(columns)
    return files
