"""The differences between models and Tables 1 and 2 of the paper, as text, Markdown and CSV."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from ...analysis.comparison import Comparison
from ...analysis.weight_curve import Tradeoff
from ...files.atomic import write_text
from .comparison_tables import differences, table_1, table_2, tradeoff_table
from .report_table import ReportTable, kept_tables, with_tables

__all__ = [
    "ReportTable",
    "kept_tables",
    "save_tables",
    "tables",
    "tables_text",
    "with_tables",
]


def tables(found: Comparison | Tradeoff) -> list[ReportTable]:
    """The differences, Table 1 and Table 2; of a tradeoff its curve."""
    if isinstance(found, Tradeoff):
        return [tradeoff_table(found)]
    return [differences(found), table_1(found), table_2(found)]


def tables_text(found: Comparison | Tradeoff) -> str:
    """All tables as plain text."""
    return "\n".join(table.text() for table in tables(found))


def save_tables(
    found: Comparison | Tradeoff | Iterable[ReportTable], folder: str | os.PathLike[str]
) -> list[Path]:
    """Write tables, or those of a comparison, as Markdown and CSV; returns the paths."""
    paths = []
    for table in tables(found) if isinstance(found, Comparison | Tradeoff) else found:
        stem = Path(folder) / table.name
        paths += [stem.with_suffix(".md"), stem.with_suffix(".csv")]
        write_text(paths[-2], table.markdown())
        table.write_csv(paths[-1])
    return paths
