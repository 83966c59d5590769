"""The differences between models and Tables 1 and 2 of the paper, as text, Markdown and CSV."""

from ...results.report_table import ReportTable, stored_tables, with_tables
from .comparison_tables import differences, table_1, table_2, tradeoff_table

__all__ = [
    "ReportTable",
    "differences",
    "stored_tables",
    "table_1",
    "table_2",
    "tradeoff_table",
    "with_tables",
]
