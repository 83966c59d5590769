"""Tables that a solution keeps, so that its report shows them whenever it is made."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .table import Table

if TYPE_CHECKING:
    from ...results.solution import Solution

_FIELDS = ("name", "title", "columns", "rows", "notes")


def with_tables(solution: Solution, tables: Sequence[Table]) -> Solution:
    """A copy of the solution that keeps the tables, as text, through NetCDF and back."""
    kept = [{field: getattr(table, field) for field in _FIELDS} for table in tables]
    copy = type(solution)(solution.data_vars, solution.coords, solution.attrs)
    copy.attrs["tables"] = json.dumps(kept)
    return copy


def kept_tables(solution: Solution) -> list[Table]:
    """The tables that `with_tables` put there; their records, for programs, are not kept."""
    return [
        Table(records=[], **table | {"columns": tuple(table["columns"])})
        for table in json.loads(solution.attrs.get("tables", "[]"))
    ]
