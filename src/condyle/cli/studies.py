"""Commands that take a study: a file that says what varies or is unknown, and what is wanted."""

from __future__ import annotations

import inspect
from collections.abc import Container
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer.main

import condyle

from ..analysis.studies import StudyKind, studies
from ..errors import InputError
from .answer import STRICT, Answer, answer, command_line, files_line
from .command import command, further_commands
from .inputs import drawn, require_drawing
from .options import FOLDER, PAGE, TABLE, TOML, output_folder

if TYPE_CHECKING:
    import xarray as xr


@command("session session.toml --out results", "report.measured_session:measure_session")
def session(session: Path, *, out: Annotated[Path | None, FOLDER] = None) -> Answer:
    """Args:
    out: Folder for the results. Default: the name of the session file.
    """
    require_drawing(True, True)
    found = condyle.measure_session(session, out or Path(session.stem), strict=STRICT.get())
    return answer(found, command_line("view", solution=found.files[0]), found.files)


@command(
    "sweep study.toml --out sweep", "analysis.sweep.sweeping:sweep", without="mechanism motion load"
)
def sweep(
    study: Path | None = None,
    *,
    out: Annotated[Path | None, FOLDER] = None,
    scheduler: str = "processes",
    show: Path | None = None,
    figures: bool = False,
    csv: bool = False,
    missing: bool = False,
    **given: Any,
) -> Answer:
    """Parameter study: a row of measures for each variant of a mechanism.

    A study names the numbers that vary, how they are sampled, and the measures. Rows are written in
    parts: --resume continues an interrupted study.

    Args:
        out: Folder for the rows. Default: the name of the study.
        show: Show the results in the folder of a sweep, instead of running one.
        figures: Also draw figures into the folder.
        csv: Also write all rows as rows.csv into the folder.
        missing: With --part /n: print which numbers of an array of n jobs have rows to make yet.
    """
    require_drawing(figures, False)
    if (study is None) == (show is None):
        raise InputError("expected a study, or --show with the folder of a sweep")
    if study is None:
        assert show is not None
        return _rows(condyle.open_sweep(show), show, figures, csv, "")
    folder, part = out or Path(study.stem), given.get("part")
    if missing:
        return _missing_parts(folder, part)
    try:
        table = condyle.sweep(study, folder, scheduler=scheduler, **given)
    except KeyboardInterrupt:
        again = command_line("sweep", study, out=folder, part=part, resume=part is None)
        text = f"stopped; the rows in {folder} are complete. Continue: {again}"
        raise KeyboardInterrupt(text) from None
    then = command_line("sweep", show=folder)
    if part is None:
        return _rows(table, folder, figures, csv, then)
    rows, left = table.sizes["row"], table.attrs["missing"]
    text = f"Part {part} of the sweep in {folder}: {rows} rows are there"
    data = {"rows": rows, "missing": left, "folder": folder}
    return Answer(text + (f"; files {left} of rows are missing" if left else ""), data, then)


def _missing_parts(folder: Path, part: str | None) -> Answer:
    """The numbers of an array of jobs whose rows are not all there, as SLURM reads them."""
    from ..analysis.sweep.share import ranges
    from ..analysis.sweep.study_folder import missing_shares

    if part is None:
        raise InputError('--missing: expected --part "/n", n the number of jobs of the array')
    numbers = missing_shares(folder, part)
    text = f"--array={ranges(numbers)}" if numbers else "no part is missing"
    return Answer(text, {"missing": numbers, "folder": folder}, kind="result")


def _rows(table: xr.Dataset, folder: Path, figures: bool, csv: bool, then: str) -> Answer:
    """The tables of a sweep, as text and as CSV, and its figures."""
    from ..report.tables.sweep_tables import sweep_tables

    tables = sweep_tables(table)
    files = [output_folder(folder) / f"{entry.name}.csv" for entry in tables]
    for entry, file in zip(tables, files, strict=True):
        entry.write_csv(file)
    if csv:
        files.append(folder / "rows.csv")
        table.condyle.save(files[-1])
    if figures:
        from ..report.figures.sweep_figures import sweep_plots

        files += drawn(sweep_plots(table), folder / "sweep")
    data: dict[str, Any] = {
        "rows": table.sizes["row"],
        "asked": int(table.attrs["rows"]),
        "missing": table.attrs["missing"],
        "parameters": list(table.attrs["parameters"]),
        "measures": list(table.attrs["measures"]),
        **dict.fromkeys(("outcomes", "best", "main_effects", "sobol", "pareto"), ()),
        **{entry.name.replace("-", "_"): entry.records for entry in tables},
        "folder": folder,
        "files": files,
    }
    text = "\n".join(entry.text() for entry in tables)
    return Answer(f"{text}\n{files_line(files)}", data, then)


@command("design study.toml --out better", "analysis.design.designing:design")
def design(
    study: Path, *, out: Annotated[Path | None, FOLDER] = None, figures: bool = False
) -> Answer:
    """Args:
    out: Folder for the mechanism's file and tables. Default: the name of the study.
    figures: Also draw efforts before and after, and the Pareto front, into the folder.
    """
    require_drawing(figures, False)
    folder = out or Path(study.stem)
    designed = condyle.design(study)
    files = designed.save(output_folder(folder))
    if figures:
        from ..report.figures import save
        from ..report.figures.design_figures import design_figure

        files += save(design_figure(designed), folder, "design")
    return answer(designed, command_line("check", files[0]), files)


@command("optimise study.toml --out cycle.csv", "optimisation.optimal_motion:optimise")
def optimise(study: Path, *, out: Annotated[Path, TABLE], start: Path | None = None) -> Answer:
    """Args:
    out: Motion file of one period (.csv or .parquet).
    """
    from ..optimisation.optimal_motion import OptimiseStudy

    asked = OptimiseStudy.read(study)
    found = condyle.optimise(asked, start=start)
    return answer(found, command_line("run", asked.mechanism, motion=out), save=out)


@command("path robot.toml --study path.toml --out path.csv", "optimisation.path_study:plan_path")
def path(mechanism: str, *, study: Path, out: Annotated[Path, TABLE]) -> Answer:
    """Args:
    out: Motion file (.csv or .parquet).
    """
    found = condyle.plan_path(mechanism, study)
    return answer(found, command_line("run", mechanism, motion=out), save=out)


@command(
    "identify robot.toml --log run.csv --study fit.toml --out fitted.toml",
    "identification.identify:identify",
)
def identify(
    mechanism: str,
    *,
    study: Path,
    out: Annotated[Path, TOML],
    log: list[Path] | None = None,
    report: Annotated[Path | None, PAGE] = None,
) -> Answer:
    """Args:
    out: Mechanism file (.toml) with the fitted numbers, its comments kept.
    log: Log (CSV, Parquet or MCAP), may be repeated: t, joint_CHAIN or coordinates such as X (m),
        tau_CHAIN (N m or N), if any Fx .. Mz and contact_CONTACT (N).
    report: Also write a page (.html) with residuals, numbers and correlations.
    """
    require_drawing(report is not None, False)
    if not log:
        raise InputError("expected --log with a file, once or more")
    found = condyle.identify(mechanism, log, study)
    return answer(found, command_line("check", out), save=out, report=report)


@command(
    "calibrate robot.toml --poses poses.csv --study calib.toml --out fitted.toml",
    "identification.calibrate:calibrate",
)
def calibrate(mechanism: str, *, poses: Path, study: Path, out: Annotated[Path, TOML]) -> Answer:
    """Args:
    out: Mechanism file (.toml) with the fitted numbers, its comments kept.
    """
    return answer(condyle.calibrate(mechanism, poses, study), command_line("check", out), save=out)


@command("excite robot.toml --study excite.toml --out path.csv", "identification.excite:excite")
def excite(mechanism: str, *, out: Annotated[Path, TABLE], study: Path | None = None) -> Answer:
    """Args:
    out: Motion file for one period (.csv or .parquet).
    """
    found = condyle.excite(mechanism, study)
    return answer(found, command_line("run", mechanism, motion=out), save=out)


def own_studies(known: Container[str]) -> dict[str, Any]:
    """A command of every kind of study that has none yet, such as those of other packages."""
    kinds = {kind.command or name: kind for name, kind in studies().items()}
    return {name: _own_study(name, kind) for name, kind in kinds.items() if name not in known}


further_commands.append(own_studies)


def _own_study(name: str, kind: StudyKind) -> Any:
    def of_study(
        study: Path,
        *,
        out: Path | None = None,
        report: Annotated[Path | None, PAGE] = None,
        **given: Any,
    ) -> Answer:
        return study_answer(kind.solve(study, **given), study, out, report)

    def of_mechanism(
        mechanism: str,
        *,
        study: Path,
        out: Path | None = None,
        report: Annotated[Path | None, PAGE] = None,
        **given: Any,
    ) -> Answer:
        return study_answer(kind.solve(mechanism, study, **given), study, out, report)

    def study_answer(found: Any, study: Path, out: Path | None, report: Path | None) -> Answer:
        return answer(found, save=out, report=report)

    takes = next(iter(inspect.signature(kind.solve).parameters))
    work = of_mechanism if takes == "mechanism" else of_study
    work.__name__, work.__doc__ = name, f"{inspect.getdoc(kind.file)}\n{OWN.format(name)}"
    family = typer.Typer()
    command(f"{name} study.toml --out answer.csv", kind.solve, of=family)(work)
    return typer.main.get_command(family)


OWN = """
Args:
    study: Study file (TOML); condyle new --study {} writes one.
    out: File for the answer: a table (.csv or .parquet), or what the kind of study says.
    report: Also write a page (.html) with the answer, its tables and figures.
"""
