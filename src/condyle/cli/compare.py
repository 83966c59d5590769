"""condyle compare: every model on one motion."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import options
from .app import MAIN, app
from .inputs import file_stem, motion_and_load, output_folder, say


@app.command(rich_help_panel=MAIN)
def compare(
    mechanism: options.Mechanism = "masticatory",
    motion: options.Motion = None,
    load: options.Load = None,
    load_point: options.LoadPoint = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("results"),
    units: options.Units = "m,rad",
    landmark: options.Landmark = None,
    smooth: options.Smooth = None,
    rate: options.Rate = None,
    figures: Annotated[bool, typer.Option(help="Draw Figures 5 to 9 of the paper.")] = True,
    report: Annotated[
        bool, typer.Option("--report", help="Write the page of condyle report, with the tables.")
    ] = False,
    quiet: options.Quiet = False,
) -> None:
    """All models on one motion: differences, Tables 1 and 2, Figures 5 to 9 of the paper."""
    import condyle

    from ..analysis.compare import compare as compare_models
    from ..report.tables import save_tables, tables, with_tables

    machine = condyle.load(mechanism)
    path, acting = motion_and_load(motion, load, units, landmark, smooth, rate)
    comparison = compare_models(machine, path, acting, load_point)
    output_folder(out)
    files = save_tables(comparison, out)
    solution = with_tables(comparison.solution, tables(comparison))
    files.append(out / f"{file_stem(machine.name)}-compare.nc")
    solution.save(files[-1])
    if figures:
        from ..report.figures import save_figures

        files += save_figures(comparison.solution, comparison, out)
    if report:
        from ..report.page import write_report

        inputs = [file for file in (motion, load) if file is not None]
        page = out / f"{file_stem(machine.name)}.html"
        files.append(write_report(solution, page, files=inputs))
    say(quiet, str(comparison))
    say(quiet, "\nResults: " + ", ".join(str(f) for f in files))
