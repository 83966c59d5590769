"""condyle compare: every model on one motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..errors import InputError
from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import file_stem, motion_and_load, output_folder, require_drawing, warn, weight_of


@command(COMPUTE, example="condyle compare jaw.toml --motion path.csv --load bite.csv")
def compare(
    mechanism: options.Mechanism = "masticatory",
    motion: Path | None = None,
    load: Path | None = None,
    load_point: str | None = None,
    distribution: str | None = None,
    preload: float = 0.0,
    contact_weight: float = 0.0,
    tradeoff: bool = False,
    out: Path = Path("results"),
    units: str | None = None,
    landmark: str | None = None,
    smooth: str | None = None,
    rate: float | None = None,
    trim: float = 0.0,
    figures: bool = True,
    report: bool = False,
) -> Answer:
    """Every way to derive the equations, side by side.

    How far their numbers differ and what they cost, with and without the contacts: Tables 1 and 2
    and Figures 5 to 9 of the paper.

    Options:
        tradeoff: Instead of models, compare weights: the curve between least effort and least load
            on the contacts.
        out: Folder for the results.
        figures: Draw Figures 5 to 9 of the paper.
        report: Write the page of condyle report, with the tables.
    """
    require_drawing(figures, report)
    import condyle

    from ..analysis.comparison import compare as compare_models
    from ..analysis.weight_curve import tradeoff as weigh
    from ..report.tables import save_tables, tables, with_tables
    from ..report.tables.tradeoff_table import tradeoff_table

    machine = condyle.load_mechanism(mechanism)
    path, acting = motion_and_load(machine, motion, load, units, landmark, smooth, rate, trim)
    if tradeoff:
        if distribution not in (None, "weighted") or contact_weight:
            raise InputError(
                "--tradeoff goes through the weights of --distribution weighted by itself: leave "
                "--distribution and --contact-weight out"
            )
        curve = weigh(machine, path, acting, load_point, preload=preload)
        shown, solution, text = [tradeoff_table(curve)], curve.solution, ""
        data: dict[str, Any] = {"reference_force": curve.reference_force, "samples": curve.samples}
    else:
        policy: dict[str, Any] = {"distribution": distribution, "preload": preload}
        policy["contact_weight"] = weight_of(machine, contact_weight)
        comparison = compare_models(machine, path, acting, load_point, **policy)
        shown, solution, text = list(tables(comparison)), comparison.solution, str(comparison)
        unavailable = {one.label: one.reason for one in comparison.unavailable}
        data = {"samples": comparison.samples, "unavailable": unavailable}
    output_folder(out)
    files = save_tables(shown, out)
    solution, stem = with_tables(solution, shown), file_stem(machine.name)
    kept = out / f"{stem}-{'tradeoff' if tradeoff else 'compare'}.nc"
    solution.condyle.save(kept)
    files.append(kept)
    if figures and tradeoff:
        from ..report.figures import save
        from ..report.figures.tradeoff_figure import tradeoff_figure

        files += save(tradeoff_figure(curve), out, shown[0].name)
    elif figures:
        from ..report.figures import save_figures

        files += save_figures(comparison.solution, comparison, out)
    if report:
        from ..report.page import write_report

        inputs = [] if tradeoff else [file for file in (motion, load) if file is not None]
        page = kept.with_suffix(".html") if tradeoff else out / f"{stem}.html"
        files.append(write_report(solution, page, files=inputs))
    warn([*path.warnings, *acting.warnings, *solution.condyle.warnings])
    if tradeoff:
        then = command_line("report", kept)
    elif report:  # the page is there already
        then = command_line("view", solution=kept)
    else:
        then = command_line(
            "run",
            mechanism,
            motion=motion,
            load=load,
            load_point=load_point,
            distribution=distribution,
            preload=preload or None,
            contact_weight=contact_weight or None,
            out=out if out != Path("results") else None,
            units=units,
            landmark=landmark,
            smooth=smooth,
            rate=rate,
            trim=trim or None,
            report=True,
        )
    records = {table.name.replace("-", "_"): table.records for table in shown}
    about = {
        "mechanism": machine.name,
        **records,
        "warnings": solution.condyle.warnings,
        "files": files,
    }
    return Answer(f"{text or shown[0].text()}\n{files_line(files)}", data | about, then)
