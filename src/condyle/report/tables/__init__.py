"""The differences between models and Tables 1 and 2 of the paper, as text, Markdown and CSV."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from ...analysis.comparison import Comparison
from ...atomic import write_text
from .comparison_tables import differences, table_1, table_2
from .report_table import Table, kept_tables, with_tables

__all__ = [
    "Table",
    "comparison_text",
    "differences",
    "kept_tables",
    "save_tables",
    "table_1",
    "table_2",
    "tables",
    "with_tables",
]


def tables(comparison: Comparison) -> list[Table]:
    """The differences, Table 1 and Table 2."""
    return [differences(comparison), table_1(comparison), table_2(comparison)]


def comparison_text(comparison: Comparison) -> str:
    """All tables as plain text."""
    return "\n".join(table.text() for table in tables(comparison))


def save_tables(found: Comparison | Iterable[Table], folder: str | os.PathLike[str]) -> list[Path]:
    """Write tables, or those of a comparison, as Markdown and CSV; returns the paths."""
    paths = []
    for table in tables(found) if isinstance(found, Comparison) else found:
        stem = Path(folder) / table.name
        paths += [stem.with_suffix(".md"), stem.with_suffix(".csv")]
        write_text(paths[-2], table.markdown())
        table.write_csv(paths[-1])
    return paths
