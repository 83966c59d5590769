"""Streams of rows: a file of states in, a file of results out, in constant memory.

reader = StateReader(model)
with row_stream("states.csv", "out.csv", reader.known) as rows:
    for table in rows:
        rows.write({"effort": model.inverse_dynamics(**reader.state(table)).effort[:, 0]})
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, WarningError, as_flag
from ..mechanism.mechanism import COORDINATES
from ..model.model import Model
from ..motion import (
    NumberTable,
    TableWriter,
    iter_table,
    load_place,
    read_table,
    resolve_load_point,
)
from ..motion.column_units import BASE, GRAVITY, Dimension, dimension
from ..motion.gravity_and_base import gravity_and_base_columns, gravity_and_base_of
from ..motion.table_reader import CHUNK_ROWS
from ..quantities import QUANTITIES
from ..quantities.entries import WRENCH
from .accuracy import max_error_of, require_accuracy
from .contacts import contact_loss_columns
from .derived import Derived
from .failed_samples import status_columns

Columns = dict[str, np.ndarray | list[str]]
GREATEST_ACTIVATION = "Greatest activation (of muscles; of others effort over limit)"


@dataclass(frozen=True)
class StatesReport:
    """Summary of a file of rows: `data` for programs, `str` to read, in the words of `say`."""

    data: dict[str, Any]
    text: str = ""
    say: Callable[[str], str] = str

    def __str__(self) -> str:
        files = ", ".join(map(str, self.data["files"]))
        text = self.text or f"{self.data['rows']} rows solved: {files}"
        if most := self.data.get("greatest_activation"):
            text += f"\n{self.say(GREATEST_ACTIVATION)}: "
            text += "{value:.4g}, {chain} in row {row}".format(**most)
        return text


@dataclass
class RowStream:
    """Tables of a file, one after the other, and the table of what is computed for their rows.

    count: rows so far, without those of the present table;  warnings: to add to.
    """

    tables: Iterable[NumberTable]
    writer: TableWriter
    max_error: float | None
    files: list[Path]
    count: int = 0
    warnings: list[str] = field(default_factory=list)

    def __iter__(self) -> Iterator[NumberTable]:
        for table in self.tables:
            yield table
            self.count += table.rows
        self.warnings += table.warnings

    def write(self, columns: Columns, bound: np.ndarray | None = None) -> None:
        """Write columns for the rows of the present table.

        Args:   bound: of errors, (N,): column bound, in its place if the columns have one, where
                accuracy is asked for.
        Raises: AccuracyError: for a bound that is not accepted.
        """
        if self.max_error is None:
            columns.pop("bound", None)
        elif bound is not None:
            require_accuracy(bound, self.max_error, first_row=self.count)
            columns["bound"] = bound
        self.writer.write(columns)

    def report(self, say: Callable[[str], str] = str, **data: Any) -> StatesReport:
        """The summary, with further data."""
        own = {"rows": self.count, "warnings": self.warnings, "files": self.files}
        return StatesReport(data | own, say=say)


@contextmanager
def row_stream(
    source: str | Path,
    out: str | Path,
    known: Mapping[str, Dimension],
    *,
    strict: bool = False,
    max_error: float | None = None,
    in_chunks: bool = True,
) -> Iterator[RowStream]:
    """The rows of a file; at the end of the block the output appears, complete, or not at all.

    Args:   source: CSV, or Parquet if its name ends in .parquet;  out: likewise.
            known: columns that are read, and what each measures.
            strict: a warning is an error;  max_error: largest bound that is accepted.
            in_chunks: rows do not depend on those before; else they are one table.
    Raises: InputError, SampleError; WarningError: for a warning, if `strict`.
    """
    strict, max_error = as_flag(strict, "strict"), max_error_of(max_error)
    with TableWriter(out) as writer:
        tables = (
            iter_table(source, CHUNK_ROWS, known=known, doing="solving")
            if in_chunks
            else [read_table(source, known=known)]
        )
        yield (rows := RowStream(tables, writer, max_error, [Path(out)]))
        if strict and rows.warnings:
            raise WarningError(rows.warnings)


class StateReader:
    """States among the columns of tables: 6 - k pose coordinates with rates, and what acts on them.

    Args: load_point: at which loads act; None: as `resolve_load_point` finds it.
          by_effort: states have efforts in the place of accelerations.
    """

    def __init__(
        self,
        model: Model,
        load_point: str | None = None,
        threads: int | None = None,
        by_effort: bool = False,
    ) -> None:
        self.model, self.load_point, self.threads = model, load_point, threads
        effort = QUANTITIES["effort"].dimensions(model.mechanism)
        self.efforts = effort if by_effort else {}
        self.rates = ("d",) if by_effort else ("d", "dd")
        names = [prefix + name for prefix in ("", *self.rates) for name in COORDINATES]
        names += [*WRENCH, *GRAVITY, *BASE]
        kinds = {name: kind for name in names if (kind := dimension(name)) is not None}
        self.known: dict[str, Dimension] = kinds | self.efforts

    def names(self, table: NumberTable) -> list[str]:
        """The pose coordinates that a file gives, 6 - k.

        Raises: InputError: for another number of them, or columns that would not be used.
        """
        names, independent = [n for n in COORDINATES if n in table.columns], self.model.independent
        if len(names) != len(independent):
            more = ", and efforts tau_<chain>" if self.efforts else " and accelerations (ddX ...)"
            raise InputError(
                f"{table.source}: got the pose coordinates {', '.join(names) or 'none'}; a state "
                f"of this mechanism has {len(independent)}, such as {', '.join(independent)}, with "
                f"their rates (dX ...){more}"
            )
        used = {prefix + name for prefix in ("", *self.rates) for name in names}
        used |= {*WRENCH, *GRAVITY, *BASE, *self.efforts}
        if idle := [name for name in table.columns if name not in used]:
            more = "" if self.efforts else " and accelerations"
            raise InputError(
                f"{table.source}: {', '.join(idle)} would not be used: the state is given by "
                f"{', '.join(names)}, their rates{more}. Remove the other columns"
            )
        return names

    def require_independent(self, table: NumberTable, why: str) -> None:
        """Raises InputError where a file gives other coordinates than the independent ones."""
        if {*(names := self.names(table))} != {*self.model.independent}:
            raise InputError(
                f"{table.source} gives {', '.join(names)}; {why} the independent coordinates "
                f"{', '.join(self.model.independent)}: give these"
            )

    def state(self, table: NumberTable) -> dict[str, Any]:
        """States, loads on the platform, gravity and the base's motion, as models take them.

        Without any rates states are at rest; a load is zero where there is none.
        """
        names, rest = self.names(table), self.rest(table)
        given = [table.require(names)]
        for prefix in self.rates:
            still = np.zeros_like(given[0])
            given.append(still if rest else table.require([prefix + name for name in names]))
        q, v, a = [*given, np.zeros_like(given[0])][:3]
        q, v, a = self.model.poses.states(names, (q, v, a), threads=self.threads)
        last = {"effort": table.require(self.efforts)} if self.efforts else {"a": a}
        point, points = self.load_point, self.model.mechanism.platform.points
        at: str | np.ndarray | None = point
        if point is not None or {*table.columns} & {*WRENCH[:3]}:
            named = point is None or (isinstance(point, str) and point in points)
            at = resolve_load_point(point, points) if named else load_place(point, points)
        gravity_and_base_columns(table.columns, table.source)
        acting = {"wrench": table.filled(WRENCH), "at": at, **gravity_and_base_of(table.columns)}
        return {"q": q, "v": v, **last, **acting}

    def rest(self, table: NumberTable) -> list[str]:
        """The warning that states are at rest, where a file has no rates at all."""
        if any(p + name in table.columns for p in self.rates for name in COORDINATES):
            return []
        more = "" if self.efforts else " and no accelerations (ddX ...)"
        return [f"{table.source}: no rates (dX ...){more} are given: the states are at rest"]


def contact_and_status(derived: Derived, flag: bool) -> Columns:
    """Columns of lost contacts and, where failed rows are kept, of the status and its cause."""
    columns: Columns = {**contact_loss_columns(derived.mechanism, derived.contact_loss)}
    if flag:
        shortfall = derived.shortfall if derived.limited else None
        columns |= status_columns(derived.mechanism, derived.status, derived.cause, shortfall)
    return columns
