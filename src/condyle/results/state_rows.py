"""States of a mechanism, one a row: a file in, a file out, in flat memory.

Rows never influence each other. What is computed for a row is in `inverse_rows`
and `forward_rows`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, WarningError, as_flag
from ..mechanism.mechanism import COORDINATES
from ..model.model import Model
from ..model.poses import States
from ..motion import NumberTable, TableWriter, iter_table, resolve_load_point
from ..motion.column_units import BASE, GRAVITY, Dimension, dimension
from ..motion.gravity_and_base import Given, columns_beside, given_beside
from ..quantities.entries import WRENCH

CHUNK_ROWS = 16384

Columns = dict[str, np.ndarray | list[str]]


@dataclass(frozen=True)
class StatesReport:
    """Summary of a file of states: `data` for programs, `str` to read."""

    data: dict[str, Any]
    said: str = ""

    def __str__(self) -> str:
        if self.said:
            return self.said
        text = f"{self.data['rows']} rows solved: {', '.join(map(str, self.data['files']))}"
        if most := self.data.get("greatest_activation"):
            text += f"\nGreatest activation (effort over its limit): {most['value']:.4g}, "
            text += f"{most['chain']} in row {most['row']}"
        return text


@dataclass(frozen=True)
class StateColumns:
    """The columns of a file that make a state.

    rates:  prefixes of its derivatives: d, dd;  missing: the warning where there are none.
    wanted: the other columns of a state, for messages;  others: further columns, by dimension.
    """

    model: Model
    rates: tuple[str, ...]
    missing: str
    wanted: str
    others: Mapping[str, Dimension] = field(default_factory=dict)

    def known(self) -> dict[str, Dimension]:
        """The columns that are read."""
        names = [prefix + name for prefix in ("", *self.rates) for name in COORDINATES]
        names += [*WRENCH, *GRAVITY, *BASE]
        own = {name: kind for name in names if (kind := dimension(name)) is not None}
        return own | dict(self.others)

    def names(self, table: NumberTable) -> list[str]:
        """The pose coordinates that a file gives, 6 - k."""
        names, independent = [n for n in COORDINATES if n in table.columns], self.model.independent
        if len(names) != len(independent):
            raise InputError(
                f"{table.source}: got the pose coordinates {', '.join(names) or 'none'}; a state "
                f"of this mechanism has {len(independent)}, such as {', '.join(independent)}, with "
                f"their rates {self.wanted}"
            )
        return names

    def at_rest(self, table: NumberTable) -> bool:
        """Whether a file has no derivatives at all."""
        return not any(p + name in table.columns for p in self.rates for name in COORDINATES)

    def states(self, table: NumberTable, names: list[str], threads: int | None) -> States:
        """q_EE and its rates; zero where they are not given."""
        given = [table.require(names)]
        for prefix in self.rates:
            rest = self.at_rest(table)
            own = np.zeros_like(given[0]) if rest else table.require([prefix + n for n in names])
            given.append(own)
        q, q1, q2 = [*given, np.zeros_like(given[0])][:3]
        return self.model.poses.states(names, (q, q1, q2), threads=threads)

    def loads(self, table: NumberTable, load_point: str | None) -> tuple[np.ndarray, str | None]:
        """Wrenches of a table, (N, 6): zero where it has none; and their point, where there is a
        force."""
        wrench, point = table.filled(WRENCH), None
        if load_point is not None or {*table.columns} & {*WRENCH[:3]}:
            point = resolve_load_point(load_point, self.model.mechanism.platform.points)
        return wrench, point

    def given(self, table: NumberTable) -> Given:
        """Gravity and the base's motion, where a table has them, as models take them."""
        columns_beside(table.columns, table.source)
        return given_beside(table.columns)

    def stream(
        self,
        source: str | Path,
        out: str | Path,
        solved: Callable[[NumberTable, int], Columns],
        done: Callable[[], list[str]] = list,
        strict: bool = False,
    ) -> tuple[int, list[str]]:
        """Every row of a file solved; the output appears whole or not at all.

        Args:    source: CSV, or Parquet if its name ends in .parquet;  out: likewise.
                 solved: output columns for the rows of a table, from the number of its first row.
                 done: called before the output appears; returns further warnings.
                 strict: a warning is an error.
        Returns: number of rows, and warnings.
        Raises:  WarningError: for one, if `strict`.
        """
        rows, said, strict = 0, list[str](), as_flag(strict, "strict")
        with TableWriter(out) as writer:
            for table in iter_table(source, CHUNK_ROWS, known=self.known(), doing="solving"):
                writer.write(solved(table, rows))
                rows += table.rows
                said = list(table.warnings)
                if self.at_rest(table):
                    said.append(f"{table.source}: {self.missing}: the states are at rest")
            said += done()
            if strict and said:
                raise WarningError(said)
        return rows, said
