"""condyle sweep: many variants of a mechanism."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import output_folder, require_drawing

if TYPE_CHECKING:
    import xarray as xr


@command(COMPUTE, example="condyle sweep study.toml --out sweep")
def sweep(
    study: Annotated[Path | None, typer.Argument(help="Study file (TOML).")] = None,
    out: Path | None = None,
    workers: int | None = None,
    scheduler: str = "processes",
    resume: bool = False,
    show: Path | None = None,
    figures: bool = False,
    csv: bool = False,
) -> Answer:
    """Parameter study: a row of measures for each variant of a mechanism.

    A study names the numbers that vary, how they are sampled, and the measures. Rows are written in
    parts: --resume continues an interrupted study.

    Options:
        out: Folder for the rows. Default: the name of the study.
        workers: Number of processes. Default: all processors.
        scheduler: Where rows are computed: processes, threads, or the address of a Dask
            scheduler, tls://... or tcp://..., which runs code as you: see the guide on sweeps.
        resume: Continue from the rows in the folder.
        show: Show the results in the folder of a sweep, instead of running one.
        figures: Also draw figures into the folder.
        csv: Also write all rows as rows.csv into the folder.
    """
    require_drawing(figures, False)
    import condyle

    if (study is None) == (show is None):
        raise InputError("expected a study, or --show with the folder of a sweep")
    if show is not None:
        return _shown(condyle.open_sweep(show), show, figures, csv)
    assert study is not None
    folder = out or Path(study.stem)
    try:
        table = condyle.sweep(study, folder, workers=workers, scheduler=scheduler, resume=resume)
    except KeyboardInterrupt:
        again = command_line("sweep", study, out=folder, resume=True)
        said = f"stopped; the rows in {folder} are complete. Continue: {again}"
        raise KeyboardInterrupt(said) from None
    return _shown(table, folder, figures, csv)


def _shown(table: xr.Dataset, folder: Path, figures: bool, csv: bool) -> Answer:
    """The tables of a sweep, as text and as CSV, and its figures."""
    from ..report.tables.sweep_tables import sweep_tables

    tables = sweep_tables(table)
    files = []
    for one in tables:
        files.append(output_folder(folder) / f"{one.name}.csv")
        one.write_csv(files[-1])
    if csv:
        files.append(folder / "rows.csv")
        table.condyle.save(files[-1])
    if figures:
        from ..report.figures import save
        from ..report.figures.sweep_figures import sweep_plots

        for name in (plots := sweep_plots(table)):
            files += save(getattr(plots, name)(), folder, f"sweep-{name}")
    data: dict[str, Any] = {
        "rows": table.sizes["row"],
        "asked": int(table.attrs["rows"]),
        "parameters": list(table.attrs["parameters"]),
        "measures": list(table.attrs["measures"]),
        **dict.fromkeys(("outcomes", "best", "main_effects", "sobol", "pareto"), ()),
        **{one.name.replace("-", "_"): one.records for one in tables},
        "folder": folder,
        "files": files,
    }
    text = "\n".join(one.text() for one in tables)
    return Answer(f"{text}\n{files_line(files)}", data, command_line("sweep", show=folder))
