"""condyle compare: every model on one motion."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import file_stem, motion_and_load, output_folder, require_drawing, warn, weight_of
from .tradeoff import require_free_weight, weigh

if TYPE_CHECKING:
    from ..analysis.comparison import Comparison


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
    from ..report.tables import save_tables, tables, with_tables

    machine = condyle.load(mechanism)
    path, acting = motion_and_load(machine, motion, load, units, landmark, smooth, rate, trim)
    if tradeoff:
        require_free_weight(distribution, contact_weight)
        return weigh(machine, path, acting, load_point, preload, out, figures, report)
    weight = weight_of(machine, contact_weight)
    policy: dict[str, Any] = {
        "distribution": distribution,
        "preload": preload,
        "contact_weight": weight,
    }
    comparison = compare_models(machine, path, acting, load_point, **policy)
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
    warn([*path.warnings, *acting.warnings, *solution.warnings])
    if report:  # the page is there already
        then = command_line("view", solution=out / f"{file_stem(machine.name)}-compare.nc")
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
    return Answer(f"{comparison}\n{files_line(files)}", _data(comparison) | {"files": files}, then)


def _data(comparison: Comparison) -> dict[str, Any]:
    from ..report.tables import tables

    return {
        "mechanism": comparison.mechanism.name,
        "samples": comparison.samples,
        **{table.name.replace("-", "_"): table.records for table in tables(comparison)},
        "unavailable": {one.label: one.reason for one in comparison.unavailable},
        "warnings": comparison.solution.warnings,
    }
