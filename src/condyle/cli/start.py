"""Commands to begin with: files to start from, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import condyle

from ..errors import UnsupportedError
from ..extras import require
from .answer import STRICT, Answer, answer, command_line, files_line, warn
from .command import command, family
from .options import FOLDER, TABLE, output_folder, written


@command("new my-robot --from gough-stewart", "export.new_mechanism:new_mechanism")
def new(
    name: str | None = None,
    *,
    from_: str | None = None,
    from_mjcf: Path | None = None,
    study: str | None = None,
    list_: bool = False,
    force: bool = False,
) -> Answer:
    """Mechanism file to start from, commented, or study file.

    Args:
    name: Name of the mechanism or study; the file is NAME.toml.
    from_: Copy the file of this bundled mechanism, by its name or a word of it:
        gough-stewart, hexaglide, cable, jaw; --list shows all. Or make a jaw of the muscles of an
        OpenSim model (.osim) or a table of muscle points (.csv).
    study: Write a study file of this kind instead: <names>.
    list_: Show the bundled mechanisms and the kinds of study files, a line each.
    """
    sources = {"--from": from_, "--from-mjcf": from_mjcf, "--study": study}
    given = [option for option, value in sources.items() if value is not None]
    if list_:
        if name is not None or given or force:
            raise UnsupportedError("--list writes no file: leave the name and other options out")
        return _listed()
    if name is None:
        raise UnsupportedError("condyle new needs a name; the file is NAME.toml. Or take --list")
    if len(given) > 1:
        raise UnsupportedError(f"{' and '.join(given)} each say what to write; take one")
    if study is not None:
        path = condyle.new_study(name, study, force=force)  # type: ignore[arg-type]  # any kind
        return Answer(f"Wrote {path}", {"files": [path]}, command_line("schema", study))
    how: dict[str, Any] = {"from_bundled": from_, "from_mjcf": from_mjcf, "force": force}
    made = condyle.new_mechanism(name, strict=STRICT.get(), **how)
    warn(made.warnings)
    return Answer(f"Wrote {made.path}", {"files": [made.path]}, command_line("check", made.path))


def _listed() -> Answer:
    from ..analysis.new_study import study_lines
    from ..export.new_mechanism import mechanism_lines

    tables = {"mechanisms": mechanism_lines(), "studies": study_lines()}
    width = max(len(name) for lines in tables.values() for name in lines)
    text = []
    for title, lines in zip(("--from", "--study"), tables.values(), strict=True):
        text += [title, *(f"  {name:<{width}}  {line}" for name, line in lines.items())]
    then = command_line("new", "my-robot", **{"from": "gough-stewart"})
    return Answer("\n".join(text), tables, then, "result")


@command("check jaw.toml")
def check(
    mechanism: str,
    *,
    project: bool = False,
    of: str | None = None,
    picture: Annotated[Path | None, written(".svg")] = None,
) -> Answer:
    """Summary of a mechanism, or every mistake in its file; also in a scenario or study file.

    Args:
    project: If contact points are off their surfaces, show the nearest home that is on them.
    of: Kind of file: <names>. Default: the kind that has most of the file's keys.
    picture: Draw home to this file (.svg); of a singular home with the motion that is free.
    """
    if project and picture is not None:
        raise UnsupportedError("--picture draws the home of the file: leave --project out")
    if of or Path(mechanism).is_file():
        from ..analysis.studies import read_study, studies

        kind, study = read_study(mechanism, of)
        if study is not None:
            if project or picture is not None:
                raise UnsupportedError(
                    f'{mechanism} is a file of kind "{kind}": --project and --picture are for '
                    "mechanisms"
                )
            then = command_line("simulate", scenario=mechanism)
            if kind != "scenario":
                then = command_line(studies()[kind].command or kind, "--help")
            data = {"kind": kind, "tables": study.data()}
            return Answer(f"{mechanism}: {kind}, no mistakes", data, then, "result")
    if project:
        from ..kinematics.project import project_home
        from ..mechanism.files import from_data
        from ..mechanism.quantities import PER_METRE
        from ..mechanism.toml import read_tables, read_text

        tables = read_tables(read_text(mechanism), mechanism)
        projection = project_home(from_data(tables, mechanism, at_home=False))
        if projection.needed:
            text = projection.text(PER_METRE[tables.get("length_unit", "m")])
            text += "\n\nChange the points in the file to these, then check again."
            then = command_line("check", mechanism, project=True)
            return Answer(text, projection.data(), then, "result")
    files = None if picture is None else [picture]
    return answer(condyle.check(mechanism, picture), command_line("run", mechanism), files)


@command("reference --out case")
def reference(*, out: Annotated[Path, FOLDER] = Path()) -> Answer:
    """Write the bundled motion and bite force as files.

    Examples of the tables that condyle run reads. Both are synthetic, not measured.

    Args:
        out: Folder for the files.
    """
    motion, load = files = condyle.write_reference(output_folder(out))
    then = command_line("run", motion=motion, load=load)
    return Answer(f"Wrote {motion}\nWrote {load}", {"files": files}, then)


@command(
    "motion from-c3d chewing.c3d --markers markers.toml --mechanism jaw.toml --out chewing.csv",
    "markers.marker_motion:motion_from_c3d",
    of=family("motion", "Motions from laboratory recordings."),
)
def from_c3d(
    recording: Path,
    *,
    markers: Path,
    mechanism: str,
    out: Annotated[Path, TABLE],
    max_residual: float = 2.0,
    max_gap: float = 0.1,
    longest: bool = False,
    units: str | None = None,
    measured: Annotated[Path | None, TABLE] = None,
    load: Annotated[Path | None, TABLE] = None,
    force: str | None = None,
) -> Answer:
    """Convert recorded markers (C3D, TRC, CSV, Parquet, JTS) to a motion.

    Fits both bodies, subtracts the motion of the fixed one and gives the pose of the platform in
    the mechanism's frame. Gaps are filled up to --max-gap and listed.

    Args:
        recording: Marker recording (C3D, TRC, CSV or Parquet), or frames of the Jaw Tracking System
            (.h5, .hdf5).
        markers: Marker file (TOML): fixed markers, markers on the platform, time at which the
            mechanism is at home (s), its points in the laboratory (register), channels of force
            (forces) and muscles (emg).
        out: File for the motion (.csv or .parquet): t (s), X, Y, Z (m), alpha, beta, gamma (rad).
        max_residual: Largest distance of a marker from its place in its body (mm); a frame beyond
            it is a gap.
        units: Unit of length (m, cm, mm, um) that overrides the recording's.
        measured: File for the other measured channels (.csv or .parquet), for run --measured:
            markers in the mechanism's frame, their residuals (m), EMG (emg).
        load: File for the load from the channels of the marker file (forces) or of --force.
        force: Three channels such as Fx,Fy,Fz: a force on the platform (N, kN, mN) along the
            laboratory's axes, instead of the marker file's.
    """
    from .. import markers as marked

    if recording.suffix.lower() == ".c3d":
        require("c3d", "c3d")
    if force is not None and load is None:
        raise UnsupportedError("--force requires --load, the file for the load of its channels")
    channels = None if force is None else tuple(name.strip() for name in force.split(","))
    result = marked.motion_from_c3d(
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
    if result.load is not None and load is None:
        unused.append("the marker file names a load (forces), and --load no file for it")
    if result.channels.emg and measured is None:
        unused.append("the marker file names EMG (emg), and --measured no file for it")
    warn([*result.warnings, *unused])
    files = marked.write_motion(result, out, measured, load)
    point = result.load.point if result.load is not None and load is not None else None
    how: dict[str, Any] = {"motion": out, "load": load, "load_point": point, "smooth": "auto"}
    if measured is not None:
        how |= {"measured": measured, "report": True}
    then = command_line("run", mechanism, **how)
    return Answer(f"{result}\n{files_line(files)}", marked.as_data(result) | {"files": files}, then)
