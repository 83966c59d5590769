"""A table of a report: text and Markdown for people, CSV for programs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from ..motion.table_writer import write_table

if TYPE_CHECKING:
    import xarray as xr

NOTHING = "-"
WIDTH = 100  # of notes in plain text
_FIELDS = ("name", "title", "columns", "rows", "notes")
Cell = str | Callable[[dict[str, Any]], str]


@dataclass(frozen=True)
class ReportTable:
    """A table of text for people, the same numbers for programs, and the notes under it.

    rows: cells as text, as many as there are columns.   records: one a row of the CSV.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: list[list[str]]
    records: list[dict[str, Any]]
    notes: list[str]

    @classmethod
    def of(
        cls,
        name: str,
        title: str,
        records: Sequence[dict[str, Any]],
        cells: Mapping[str, Cell],
        notes: Sequence[str] = (),
        shown: Sequence[int] | None = None,
    ) -> ReportTable:
        """A table of records.

        Args: cells: heading -> "key:format" of a record, or a function of it; blanks at the end
                of a heading only tell equal ones apart.   shown: rows that people see.
        """
        chosen = records if shown is None else [records[i] for i in shown]
        rows = [[_cell(record, cell) for cell in cells.values()] for record in chosen]
        return cls(name, title, tuple(map(str.strip, cells)), rows, list(records), list(notes))

    def in_words(self, say: Callable[[str], str]) -> ReportTable:
        """The same for people of other words: title, headings and notes; records stay."""
        columns, notes = tuple(map(say, self.columns)), list(map(say, self.notes))
        return replace(self, title=say(self.title), columns=columns, notes=notes)

    def text(self) -> str:
        widths = [max(map(len, column)) for column in zip(self.columns, *self.rows, strict=True)]
        lines = [self.title]
        for row in (self.columns, ["-" * width for width in widths], *self.rows):
            first, *others = zip(row, widths, strict=True)
            cells = [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
            lines.append("  ".join(cells).rstrip())
        for note in self.notes:
            lines += wrap(note, WIDTH, initial_indent="- ", subsequent_indent="  ")
        return "\n".join(lines) + "\n"

    def markdown(self) -> str:
        rule = ["---"] + ["---:"] * (len(self.columns) - 1)
        lines = [" | ".join(row).join(("| ", " |")) for row in (self.columns, rule, *self.rows)]
        notes = [f"- {note}" for note in self.notes]
        return "\n".join([f"**{self.title}**", "", *lines, "", *notes]) + "\n"

    @property
    def numbers(self) -> dict[str, list[Any]]:
        """Its records, by column; a number that there is not is NaN, or an empty cell of text."""
        columns: dict[str, list[Any]] = {}
        for name in self.records[0] if self.records else ():
            values = [record[name] for record in self.records]
            hole = "" if any(isinstance(value, str) for value in values) else float("nan")
            columns[name] = [hole if value is None else value for value in values]
        return columns

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the records as CSV, one per row."""
        write_table(path, self.numbers, parquet=False)


def _cell(record: dict[str, Any], cell: Cell) -> str:
    if callable(cell):
        return cell(record)
    key, _, form = cell.partition(":")
    value = record[key]
    return NOTHING if value is None or value == "" else format(value, form)


def with_tables(solution: xr.Dataset, tables: Sequence[ReportTable]) -> xr.Dataset:
    """A copy of the solution with the tables as text, which NetCDF keeps."""
    kept = [{field: getattr(table, field) for field in _FIELDS} for table in tables]
    copy = type(solution)(solution.data_vars, solution.coords, solution.attrs)
    copy.attrs["tables"] = json.dumps(kept)
    return copy


def stored_tables(solution: xr.Dataset) -> list[ReportTable]:
    """The tables that `with_tables` put there; their records, for programs, are not kept."""
    return [
        ReportTable(records=[], **table | {"columns": tuple(table["columns"])})
        for table in json.loads(solution.attrs.get("tables", "[]"))
    ]
