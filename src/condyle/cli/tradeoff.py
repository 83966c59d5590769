"""What `condyle compare --tradeoff` does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from .answer import Answer, command_line, files_line
from .inputs import file_stem, output_folder, warn

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from ..motion import Load, Motion


def weigh(
    machine: Mechanism,
    motion: Motion,
    load: Load,
    load_point: str | None,
    preload: float,
    out: Path,
    figures: bool,
    report: bool,
) -> Answer:
    """The curve as a table, a CSV, a figure and a solution that keeps the table."""
    from ..analysis.weight_curve import tradeoff
    from ..atomic import write_text
    from ..report.tables import with_tables
    from ..report.tables.tradeoff_table import tradeoff_table

    found = tradeoff(machine, motion, load, load_point, preload=preload)
    table = tradeoff_table(found)
    stem = output_folder(out) / table.name
    files = [stem.with_suffix(".md"), stem.with_suffix(".csv")]
    write_text(files[0], table.markdown())
    table.write_csv(files[1])
    solution = with_tables(found.solution, [table])
    files.append(out / f"{file_stem(machine.name)}-tradeoff.nc")
    solution.save(files[-1])
    if figures:
        from ..report.figures import save
        from ..report.figures.tradeoff_figure import tradeoff_figure

        files += save(tradeoff_figure(found), out, table.name)
    if report:
        from ..report.page import write_report

        files.append(write_report(solution, out / f"{file_stem(machine.name)}-tradeoff.html"))
    warn([*motion.warnings, *load.warnings, *solution.warnings])
    data = {
        "mechanism": machine.name,
        "samples": found.samples,
        "reference_force": found.reference_force,
        "tradeoff": table.records,
        "warnings": solution.warnings,
        "files": files,
    }
    then = command_line("report", files[2])
    return Answer(f"{table.text()}\n{files_line(files)}", data, then)


def require_free_weight(distribution: str | None, contact_weight: float) -> None:
    """Raises InputError where the choice that the curve goes through is made already."""
    if distribution not in (None, "weighted") or contact_weight:
        raise InputError(
            "--tradeoff goes through the weights of --distribution weighted by itself: leave "
            "--distribution and --contact-weight out"
        )
