"""A table of a report: text and Markdown for people, CSV for programs."""

from __future__ import annotations

import os
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

from ...motion import write_table

NOTHING = "-"
WIDTH = 100  # of notes in plain text


@dataclass(frozen=True)
class Table:
    """A table for people, its numbers for programs, and what must be said under it.

    rows: cells as text, as many as there are columns.   records: one a row of the CSV.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: list[list[str]]
    records: list[dict[str, Any]]
    notes: list[str]

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

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """One record a row; a number that there is not is an empty cell."""
        columns: dict[str, list[Any]] = {}
        for name in self.records[0] if self.records else ():
            values = [record[name] for record in self.records]
            words = any(isinstance(value, str) for value in values)
            hole = "" if words else float("nan")
            columns[name] = [hole if value is None else value for value in values]
        write_table(path, columns)


def cell(value: Any, form: str) -> str:
    return NOTHING if value is None else form.format(value)
