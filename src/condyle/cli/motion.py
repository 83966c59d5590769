"""condyle motion: motions from laboratory recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import completion, options
from .answer import Answer, command_line, files_line
from .command import START, command, group
from .inputs import warn

motion = group("motion", START, "Motions from laboratory recordings.")


@command(
    START,
    example="condyle motion from-c3d chewing.c3d --markers markers.toml --mechanism jaw.toml "
    "--out chewing.csv",
    of=motion,
    name="from-c3d",
)
def from_c3d(
    recording: Annotated[Path, typer.Argument(help="Marker recording (C3D, TRC, CSV or Parquet).")],
    markers: Path,
    mechanism: Annotated[
        str,
        typer.Option(
            help="Mechanism file (TOML) or name of a bundled mechanism that the markers belong to.",
            autocompletion=completion.mechanisms,
        ),
    ],
    out: Path,
    max_residual: Annotated[float, options.option(min=0.0)] = 2.0,
    max_gap: Annotated[float, options.option(min=0.0)] = 0.1,
    longest: bool = False,
    units: Annotated[
        str | None,
        typer.Option(
            help="Unit of length (m, cm, mm, um) that overrides the recording's.",
            autocompletion=completion.one_of("mm", "m", "cm", "um"),
        ),
    ] = None,
    measured: Path | None = None,
    load: Path | None = None,
    force: str | None = None,
) -> Answer:
    """Convert recorded markers (C3D, TRC, CSV or Parquet) to a motion.

    Fits both bodies, subtracts the motion of the fixed one and gives the pose of the platform in
    the mechanism's frame. Gaps are filled up to --max-gap and listed.

    Options:
        markers: Marker file (TOML): fixed markers, markers on the platform, time at which the
            mechanism is at home (s), its points in the laboratory (register), channels of force
            (forces) and muscles (emg).
        out: File for the motion (.csv or .parquet): t (s), X, Y, Z (m), alpha, beta, gamma (rad).
        longest: If a gap is too long to fill, keep the longest gap-free interval.
        measured: File for the other measured channels (.csv or .parquet), for run --measured:
            markers in the mechanism's frame, their residuals (m), EMG (emg).
        load: File for the load from the channels of the marker file (forces) or of --force.
        force: Three channels such as Fx,Fy,Fz: a force on the platform (N, kN, mN) along the
            laboratory's axes, instead of the marker file's.
        max_residual: Largest distance of a marker from its place in its body (mm); a frame beyond
            it is a gap.
        max_gap: Longest gap to fill by a spline (s).
    """
    import condyle

    from .. import markers as marked
    from ..errors import UnsupportedError
    from ..extras import require

    if recording.suffix.lower() == ".c3d":
        require("c3d", "c3d")
    if force is not None and load is None:
        raise UnsupportedError("--force requires --load, the file for the load of its channels")
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
    unused = []
    if found.load is not None and load is None:
        unused.append("the marker file names a load (forces), and --load no file for it")
    if found.channels.emg and measured is None:
        unused.append("the marker file names EMG (emg), and --measured no file for it")
    warn([*found.warnings, *unused])
    files = marked.write_motion(found, out, measured, load)
    point = found.load.point if found.load is not None and load is not None else None
    beside = {"measured": measured, "report": True} if measured is not None else {}
    then = command_line(
        "run", mechanism, motion=out, load=load, load_point=point, smooth="auto", **beside
    )
    return Answer(f"{found}\n{files_line(files)}", marked.as_data(found) | {"files": files}, then)
