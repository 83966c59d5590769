"""condyle motion: motions from what laboratories record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import completion
from .answer import Answer, command_line, files_line
from .command import BEGIN, command, group
from .inputs import warn

motion = group("motion", BEGIN, "Motions from what laboratories record.")


@command(
    BEGIN,
    example="condyle motion from-c3d chewing.c3d --markers markers.toml --mechanism jaw.toml "
    "--out chewing.csv",
    of=motion,
    name="from-c3d",
)
def from_c3d(
    recording: Annotated[Path, typer.Argument(help="Recording of markers (C3D).")],
    markers: Path,
    mechanism: Annotated[
        str,
        typer.Option(
            help="Mechanism file (TOML) or name that the points are of.",
            autocompletion=completion.mechanisms,
        ),
    ],
    out: Path,
    max_residual: float = 2.0,
    max_gap: float = 0.1,
    longest: bool = False,
    units: Annotated[
        str | None,
        typer.Option(
            help="Unit of lengths (m, cm, mm, um) in place of what the recording says.",
            autocompletion=completion.one_of("mm", "m", "cm", "um"),
        ),
    ] = None,
    measured: Path | None = None,
    load: Path | None = None,
    force: str | None = None,
) -> Answer:
    """Markers of a C3D file as a motion.

    Fits both bodies, takes the motion of the fixed one out and gives the pose of the platform in
    the mechanism's frame. Gaps are filled up to --max-gap and listed.

    Options:
        markers: Marker file (TOML): which markers are fixed and which move with the platform, when
            the mechanism is at home (s), points of it in the laboratory (register), and channels of
            force (forces) and muscles (emg).
        out: File for the motion (.csv or .parquet): t (s), X, Y, Z (m), alpha, beta, gamma (rad).
        longest: Of longer gaps take the longest stretch without one, not an error.
        measured: File for what was measured beside it (.csv or .parquet), to be shown by run
            --measured: markers in the mechanism's frame, their residuals (m), EMG (emg).
        load: File for the load that the marker file names (forces), or --force.
        force: Three channels, as in Fx,Fy,Fz: a force on the platform (N, kN, mN) along the
            laboratory's axes, in place of what the marker file names.
        max_residual: A frame in which a marker is farther (mm) from its place in its body is a gap.
        max_gap: Fill gaps up to so many seconds by a spline.
    """
    import condyle

    from .. import markers as marked
    from ..errors import UnsupportedError
    from ..extras import require

    require("c3d", "c3d")

    if force is not None and load is None:
        raise UnsupportedError("--force names channels; --load names the file for their load")
    channels = None if force is None else tuple(name.strip() for name in force.split(","))
    found = marked.motion_from_c3d(
        recording,
        markers,
        condyle.load_mechanism(mechanism),
        max_residual=max_residual / 1e3,
        max_gap=max_gap,
        longest=longest,
        unit=units,
        force=channels,
    )
    files = marked.write_motion(found, out, measured, load)
    forgotten = []
    if found.load is not None and load is None:
        forgotten.append("the marker file names a load (forces), and --load no file for it")
    if found.channels.emg and measured is None:
        forgotten.append("the marker file names EMG (emg), and --measured no file for it")
    warn([*found.warnings, *forgotten])
    point = found.load.point if found.load is not None and load is not None else None
    beside = {"measured": measured, "report": True} if measured is not None else {}
    then = command_line(
        "run", mechanism, motion=out, load=load, load_point=point, smooth="auto", **beside
    )
    return Answer(f"{found}\n{files_line(files)}", marked.as_data(found) | {"files": files}, then)
