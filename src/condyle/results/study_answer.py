"""What a study comes to: text for people, data for programs, a file, and a page with figures."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from ..files.atomic import write_text
from ..motion.table_writer import write_table
from .report_table import ReportTable


class StudyAnswer:
    """The base of answers, which are frozen dataclasses: a kind's own says `__str__` and `data`.

    kind:     of `condyle.analysis.studies`.
    warnings: what the reader should know.
    columns:  the table that `save` writes, by name; default: those of its `motion`.
    tables:   of the page: caption -> name -> column.
    """

    kind: ClassVar[str] = ""

    @property
    @abstractmethod
    def data(self) -> dict[str, Any]:
        """The same for programs."""

    @property
    def warnings(self) -> Sequence[str]:
        return ()

    @property
    def tables(self) -> Mapping[str, Mapping[str, Sequence[Any]]]:
        return {}

    @property
    def columns(self) -> Mapping[str, Any]:
        found: Mapping[str, Any] = self.motion.columns  # type: ignore[attr-defined]
        return found

    def save(self, path: str | os.PathLike[str]) -> Any:
        """Write what was found: a table (.csv or .parquet), or what the kind says.

        Raises: InputError: if it cannot be written.
        """
        write_table(path, self.columns)

    def write_report(self, path: str | os.PathLike[str]) -> None:
        """Write a page (.html) with the answer, its numbers and its figures.

        Raises: InputError: if it cannot be written.  MissingExtraError: without matplotlib.
        """
        from ..report.answer_page import write_page

        write_page(self, path)


class TablesAnswer(StudyAnswer):
    """An answer that is tables: a kind's own says which, and what else is known."""

    @property
    @abstractmethod
    def report_tables(self) -> list[ReportTable]:
        """For people; their records for programs."""

    def __str__(self) -> str:
        return "\n".join(table.text() for table in self.report_tables)

    @property
    def data(self) -> dict[str, Any]:
        tables = {one.name.replace("-", "_"): one.records for one in self.report_tables}
        return tables | {"warnings": list(self.warnings)}

    def save(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the tables into a folder, as Markdown and CSV."""
        files = []
        for table in self.report_tables:
            files += [Path(path) / f"{table.name}.md", Path(path) / f"{table.name}.csv"]
            write_text(files[-2], table.markdown())
            table.write_csv(files[-1])
        return files


def named_lines(values: Mapping[str, str]) -> list[str]:
    """'name  value' with values one below the other."""
    wide = max(map(len, values), default=1)
    return [f"{name:{wide}}  {value}".rstrip() for name, value in values.items()]


def limit_lines(used: Mapping[str, tuple[float, float]]) -> list[str]:
    """Largest share of each limit, and when [s], a line each."""
    return named_lines({name: f"{share:6.1%} at {t:.3f} s" for name, (share, t) in used.items()})


def limit_data(used: Mapping[str, tuple[float, float]]) -> dict[str, dict[str, float]]:
    """The same for programs."""
    return {name: {"share": share, "t": t} for name, (share, t) in used.items()}
