"""A session of recordings, from its file to solutions, tables and one report."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import WarningError, as_flag
from ..extras import require
from ..files.atomic import file_stem, make_folder, replacing, write_text
from ..markers.session_file import SessionFile
from ..progress import step
from .tables.report_table import ReportTable

if TYPE_CHECKING:
    import xarray as xr

    from ..mechanism.mechanism import Mechanism

Write = Callable[[Path], Any]


@dataclass(frozen=True, eq=False)
class MeasuredSession:
    """What a session came to.

    Attributes: solutions: trial -> solution with its markers and EMG.
                cycles: a row for each cycle: trial, words, duration, peaks and impulses, SI.
                mean: mean and standard deviation over normalised time, by trial and subject.
                mechanism: that was solved, scaled to the subject where the file asks for it.
                tables: recordings, trials, efforts, for people.
                files: written, if a folder was given.   warnings: each once.
    """

    solutions: dict[str, xr.Dataset]
    cycles: list[dict[str, Any]]
    mean: xr.Dataset
    mechanism: Mechanism
    tables: list[ReportTable]
    warnings: tuple[str, ...]
    files: list[Path] = field(default_factory=list)

    def __str__(self) -> str:
        return "\n".join(table.text() for table in self.tables)

    @property
    def data(self) -> dict[str, Any]:
        """The tables as JSON has them."""
        tables = {table.name: table.records for table in self.tables}
        return tables | {"cycles": self.cycles, "warnings": list(self.warnings)}


def measure_session(
    session: str | os.PathLike[str] | Mapping[str, Any] | SessionFile,
    out: str | os.PathLike[str] | None = None,
    *,
    strict: bool = False,
) -> MeasuredSession:
    """Motions, solutions, cycles and their means from the recordings of a session.

    Args:   session: a session file (TOML), or its tables.
            out: folder for `<trial>.nc`, `cycles.parquet`, `cycles.csv`, `mean.nc`, `report.html`,
                the tables as Markdown and CSV and, if the mechanism was scaled, its file; all
                appear, or none. None: nothing is written.
            strict: a warning is an error.
    Raises: InputError: for files that cannot be used; all problems of the session file at once.
            WarningError: for a warning, if strict.
    """
    from ..analysis.session import solve_session
    from ..analysis.session.mean_cycle import mean_dataset, mean_solution
    from ..mechanism import dumps
    from ..results.solution import write_netcdf
    from .tables.session_tables import session_tables, write_cycles

    if out is not None:
        require("plotly", "report")
        require("matplotlib", "figures")
    file, strict = SessionFile.read(session), as_flag(strict, "strict")
    solved = solve_session(file)
    if strict and solved.warnings:
        raise WarningError(solved.warnings)
    tables = session_tables(solved)
    found = MeasuredSession(
        {one.trial.name: one.solution for one in solved.trials},
        [row for one in solved.trials for row in one.rows],
        mean_dataset(solved.trials),
        solved.mechanism,
        tables,
        solved.warnings,
    )
    if out is None:
        return found
    from .page.report_page import report_html

    name = "session" if not isinstance(session, str | os.PathLike) else Path(session).name
    with step("writing the session"):
        shown = mean_solution(solved.trials, name, solved.warnings)
        page = solved.trials[0].solution if shown is None else shown
        inputs = [Path(session)] if isinstance(session, str | os.PathLike) else []
        inputs += [Path(trial.file) for trial in file.trials]
        html = report_html(page, tables=tables, files=inputs)
        writes: dict[str, Write] = {
            f"{file_stem(name)}.nc": partial(write_netcdf, solution)
            for name, solution in [*found.solutions.items(), ("mean", found.mean)]
        }
        if found.cycles:
            writes |= {
                f"cycles.{kind}": partial(write_cycles, solved.trials, parquet=kind == "parquet")
                for kind in ("parquet", "csv")
            }
        texts = {"report.html": html} | {f"{table.name}.md": table.markdown() for table in tables}
        if solved.scaled is not None:
            texts[f"{file_stem(solved.mechanism.name)}-scaled.toml"] = dumps(solved.mechanism)
        writes |= {name: partial(_write_text, text) for name, text in texts.items()}
        writes |= {f"{table.name}.csv": table.write_csv for table in tables}
        folder = make_folder(out)
        with ExitStack() as stack:
            for ending, write in writes.items():
                write(stack.enter_context(replacing(folder / ending)))
    found.files.extend(folder / ending for ending in writes)
    return found


def _write_text(text: str, path: Path) -> None:
    write_text(path, text)
