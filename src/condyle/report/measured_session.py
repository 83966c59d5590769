"""A session of recordings, from its file to solutions, tables and one report."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..analysis.session.mean_cycle import mean_dataset, mean_solution
from ..errors import WarningError, as_flag
from ..extras import require
from ..files.atomic import file_stem, make_folder, replacing, write_text
from ..markers.session_file import SessionFile
from ..mechanism import dumps
from ..motion.table_writer import write_table
from ..progress import step
from ..results.report_table import ReportTable
from ..results.study_answer import TablesAnswer
from .tables.session_tables import cycle_columns, session_tables

if TYPE_CHECKING:
    import xarray as xr

    from ..analysis.session import SolvedSession
    from ..mechanism.mechanism import Mechanism

Write = Callable[[Path], Any]


@dataclass(frozen=True, eq=False)
class MeasuredSession(TablesAnswer):
    """A session, solved, with its tables and pages.

    solved: its trials;  source: its file, if it is one;  files: written, if a folder was given.
    """

    kind = "session"
    solved: SolvedSession
    source: Path | None
    files: list[Path] = field(default_factory=list)

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that was solved, scaled to the subject where the file asks for it."""
        return self.solved.mechanism

    @property
    def warnings(self) -> tuple[str, ...]:
        return self.solved.warnings

    @property
    def solutions(self) -> dict[str, xr.Dataset]:
        """Trial -> solution with its markers and EMG."""
        return {one.trial.name: one.solution for one in self.solved.trials}

    @property
    def cycles(self) -> list[dict[str, Any]]:
        """A row for each cycle: trial, words, duration, peaks and impulses, SI."""
        return [row for one in self.solved.trials for row in one.rows]

    @cached_property
    def mean(self) -> xr.Dataset:
        """Mean and standard deviation over normalised time, by trial and group."""
        return mean_dataset(self.solved.groups)

    @cached_property
    def report_tables(self) -> list[ReportTable]:
        """Tables of recordings, markers, trials and efforts."""
        return session_tables(self.solved)

    @property
    def columns(self) -> dict[str, list[Any]]:
        return cycle_columns(self.cycles)

    @property
    def data(self) -> dict[str, Any]:
        return super().data | {"cycles": self.cycles}

    def save(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write all of it into a folder, as `measure_session` says."""
        from ..results.solution import write_netcdf
        from .page.report_page import report_html

        name, solved = "session" if self.source is None else self.source.name, self.solved
        with step("writing the session"):
            inputs = [] if self.source is None else [self.source]
            inputs += [Path(trial.file) for trial in solved.file.trials]
            pages = self._pages(name)
            writes: dict[str, Write] = {
                f"{file_stem(name)}.nc": partial(write_netcdf, solution)
                for name, solution in [*self.solutions.items(), ("mean", self.mean)]
            }
            for kind in ("parquet", "csv") if self.cycles else ():
                writes[f"cycles.{kind}"] = partial(
                    write_table, columns=self.columns, parquet=kind == "parquet"
                )
            texts = {
                file: report_html(page, tables=self.report_tables, files=inputs)
                for file, page in pages.items()
            }
            texts |= {f"{table.name}.md": table.markdown() for table in self.report_tables}
            if solved.subject.scaled is not None:
                texts[f"{file_stem(solved.mechanism.name)}-scaled.toml"] = dumps(solved.mechanism)
            writes |= {name: partial(write_text, text=text) for name, text in texts.items()}
            writes |= {f"{table.name}.csv": table.write_csv for table in self.report_tables}
            folder = make_folder(path)
            with ExitStack() as stack:
                for ending, write in writes.items():
                    write(stack.enter_context(replacing(folder / ending)))
        return [folder / ending for ending in writes]

    def _pages(self, source: str) -> dict[str, xr.Dataset]:
        """What each page shows: the mean cycle of each group, the first one's in report.html."""
        pages: dict[str, xr.Dataset] = {}
        groups = self.solved.groups
        for group, trials in groups.items():
            whose = group if len(groups) > 1 or any(trials[0].group.values()) else ""
            mean = mean_solution(trials, source, self.solved.warnings, whose)
            if mean is not None:
                stem = f"report-{file_stem(group)}" if pages else "report"
                again = f"-{len(pages)}" if f"{stem}.html" in pages else ""
                pages[f"{stem}{again}.html"] = mean
        return pages or {"report.html": self.solved.trials[0].solution}


def measure_session(
    session: str | os.PathLike[str] | Mapping[str, Any] | SessionFile,
    out: str | os.PathLike[str] | None = None,
    *,
    strict: bool = False,
) -> MeasuredSession:
    """Motions, solutions, cycles and their means from the recordings of a session.

    Args:   session: a session file (TOML), or its tables.
            out: folder for `<trial>.nc`, `cycles.parquet`, `cycles.csv`, `mean.nc`, `report.html`
                (of further tasks `report-<task>.html`), the tables as Markdown and CSV and, if the
                mechanism was scaled, its file; all appear, or none. None: nothing is written.
            strict: a warning is an error.
    Raises: InputError: for files that cannot be used; all problems of the session file at once.
            WarningError: for a warning, if strict.
    """
    from ..analysis.session import solve_session

    if out is not None:
        require("plotly", "report")
        require("matplotlib", "figures")
    file, strict = SessionFile.read(session), as_flag(strict, "strict")
    solved = solve_session(file)
    if strict and solved.warnings:
        raise WarningError(solved.warnings)
    source = Path(session) if isinstance(session, str | os.PathLike) else None
    found = MeasuredSession(solved, source)
    if out is not None:
        found.files.extend(found.save(out))
    return found
