"""condyle run: the main job."""

from __future__ import annotations

from pathlib import Path

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import (
    chosen_model,
    file_stem,
    motion_and_load,
    output_folder,
    require_drawing,
    study_for,
    warn,
)


@command(
    COMPUTE,
    example="condyle run jaw.toml --motion path.csv --units mm,deg --load bite.csv --report",
)
def run(
    mechanism: options.Mechanism = "masticatory",
    motion: Path | None = None,
    load: Path | None = None,
    load_point: str | None = None,
    formulation: str = "virtual_power",
    route: str = "core",
    distribution: str | None = None,
    preload: float = 0.0,
    contact_weight: float = 0.0,
    out: Path = Path("results"),
    units: str | None = None,
    landmark: str | None = None,
    smooth: str | None = None,
    rate: float | None = None,
    trim: float = 0.0,
    figures: bool = False,
    reactions: bool = False,
    mat: bool = False,
    report: bool = False,
    backend: str = "auto",
    threads: int | None = None,
    measured: Path | None = None,
    strict: bool = False,
    flag: bool = False,
    vary: Path | None = None,
) -> Answer:
    """Torques and contact forces along a motion.

    Without arguments: the bundled chewing robot, a synthetic chewing path and bite force.

    Options:
        out: Folder for the results.
        figures: Draw figures too.
        report: Write the page of condyle report too.
        vary: Study (TOML) whose numbers vary: quantiles of efforts and contact forces too.
    """
    require_drawing(figures, report)
    import condyle

    from ..results.summary import summarize
    from ..results.warnings import refuse

    machine = condyle.load_mechanism(mechanism)
    study = None if vary is None else study_for(vary, machine)
    path, acting = motion_and_load(machine, motion, load, units, landmark, smooth, rate, trim)
    policy = distribution, preload, contact_weight
    model = chosen_model(machine, formulation, route, backend, *policy)
    solution = model.solve(path, acting, load_point, flag, reactions, threads)
    if measured is not None:
        solution = solution.condyle.with_measured(measured)
    if strict:
        refuse(solution.condyle.notices)
    if study is not None:
        from ..analysis.sweep import with_bands

        solution = with_bands(solution, study, path, acting, mechanism=machine, workers=threads)
    folder, stem = output_folder(out), file_stem(machine.name)
    files = [folder / f"{stem}{ending}" for ending in (".nc", ".csv", *[".mat"] * mat)]
    solution.condyle.save(*files)
    if figures:
        from ..report.figures import save_solution_figures

        files += save_solution_figures(solution, folder)
    if report:
        from ..report.page import write_report

        inputs = [file for file in (motion, load, measured, vary) if file is not None]
        inputs += [Path(mechanism)] if Path(mechanism).is_file() else []
        files.append(write_report(solution, folder / f"{stem}.html", files=inputs))
    warn([*path.warnings, *acting.warnings, *solution.condyle.warnings])
    summary = summarize(solution)
    return Answer(
        f"{summary}\n\n{files_line(files)}",
        summary.data | {"files": files},
        command_line("view", solution=files[0]) if report else command_line("report", files[0]),
    )
