"""condyle compare: every model on one motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..atomic import file_stem
from ..errors import InputError
from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import can_be_folder, can_draw, output_folder, require_drawing, warn


@command(COMPUTE, example="condyle compare jaw.toml --motion path.csv --load bite.csv")
def compare(
    motion: options.MotionOptions,
    distribution: options.DistributionOptions,
    mechanism: options.Mechanism = "masticatory",
    tradeoff: bool = False,
    out: Path = Path("results"),
    figures: bool = True,
    report: options.Report = False,
) -> Answer:
    """Compare all formulations and routes on one motion.

    Differences between their numbers, and their cost, with and without the contacts: Tables 1 and 2
    and Figures 5 to 9 of the paper.

    Options:
        tradeoff: Sweep --contact-weight instead of comparing models: the curve between least effort
            and least contact force.
        out: Folder for the results.
        figures: Draw Figures 5 to 9 of the paper.
    """
    require_drawing(False, report)
    figures = can_draw(figures)
    import condyle

    from ..motion import motion_and_load
    from ..report.tables import save_tables, tables, with_tables

    machine = condyle.load_mechanism(mechanism)
    following = motion.arguments()
    load_point = following.pop("load_point")
    can_be_folder(out)
    path, acting = motion_and_load(machine, **following)
    found: Any
    if tradeoff:
        named = distribution.distribution not in (None, "weighted")
        if named or distribution.contact_weight:
            raise InputError(
                "--tradeoff sweeps the weights of --distribution weighted itself: leave "
                "--distribution and --contact-weight out"
            )
        found = condyle.tradeoff(machine, path, acting, load_point, preload=distribution.preload)
    else:
        chosen = distribution.chosen()
        found = condyle.compare(machine, path, acting, load_point, distribution=chosen)
    shown, solution = tables(found), found.solution
    warn([*path.warnings, *acting.warnings, *solution.condyle.warnings])
    files = save_tables(shown, output_folder(out))
    solution, stem = with_tables(solution, shown), file_stem(machine.name)
    kept = out / f"{stem}-{'tradeoff' if tradeoff else 'compare'}.nc"
    solution.condyle.save(kept)
    files.append(kept)
    if figures:
        from ..report.figures import save, save_figures
        from ..report.figures.tradeoff_figure import tradeoff_figure

        if tradeoff:
            files += save(tradeoff_figure(found), out, "tradeoff")
        else:
            files += save_figures(solution, found, out)
    if report:
        from ..report.page import write_report

        page = kept.with_suffix(".html") if tradeoff else out / f"{stem}.html"
        inputs = [file for file in (motion.motion, motion.load) if file is not None]
        files.append(write_report(solution, page, files=inputs))
    if tradeoff:
        then = command_line("report", kept)
    elif report:  # the page is there already
        then = command_line("view", solution=kept)
    else:
        folder = options.OutputOptions(out, report=True)
        then = command_line("run", mechanism, motion, distribution, folder)
    data = found.data | {"mechanism": machine.name}
    data |= {table.name.replace("-", "_"): table.records for table in shown}
    data |= {"warnings": solution.condyle.warnings, "files": files}
    return Answer(f"{found}\n{files_line(files)}", data, then)
