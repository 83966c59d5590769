"""Columns of numbers from files: CSV as programs and spreadsheets write it, and Parquet."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

from condyle.errors import InputError
from condyle.motion.units import Dimension, Units, dimension
from condyle.motion.words import columns_are, guess
from condyle.progress import step

CHUNK_ROWS = 16_384

Known = Collection[str] | Mapping[str, Dimension]
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Table:
    """Finite numbers by column name, in the order of the file.

    Attributes: source: what to call the table in messages, usually the path as given.
                columns: name -> (rows,), in SI where the header names a unit.
                lines: on which line of the file (from 1) each row stands, (rows,); or the rows'
                    numbers where the file has no lines.
                scale: name -> factor to SI that was applied, where the header names a unit.
                ignored: columns that were not asked for.
                counted: what `lines` counts.
    """

    source: str
    columns: dict[str, np.ndarray]
    lines: np.ndarray
    scale: dict[str, float] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()
    counted: str = "line"

    @property
    def rows(self) -> int:
        return len(self.lines)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.columns)

    @property
    def first_line(self) -> int:
        return int(self.lines[0])

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader of the results should know about the file."""
        if not self.ignored:
            return ()
        return (f"{self.source}: {columns_are(self.ignored)} not used",)

    def where(self, row: int) -> str:
        """'motion.csv, line 57' for a row counted from 0."""
        return f"{self.source}, {self.counted} {self.lines[row]}"

    def require(self, names: Iterable[str]) -> np.ndarray:
        """The columns `names` side by side, (rows, number of names).

        Raises: InputError: naming those that are missing.
        """
        names = list(names)
        if missing := [name for name in names if name not in self.columns]:
            hint = guess(missing[0], [*self.columns, *self.ignored])
            raise InputError(f"{self.source}: {columns_are(missing)} missing.{hint}")
        return np.column_stack([self.columns[name] for name in names])

    def si(self, units: Units) -> dict[str, np.ndarray]:
        """The columns in SI: by their header where that names a unit, else by `units`.

        Raises: InputError: where both are given and differ.
        """
        for name, scale in self.scale.items():
            kind = (dimension(name) or ("", 0))[0]
            if kind in units.given and not np.isclose(scale, units.scale(name), rtol=1e-12, atol=0):
                raise InputError(
                    f'{self.source}: the header of column "{name}" and the units asked for differ;'
                    f" leave out the unit of {kind} from one of them"
                )
        return {
            name: column if name in self.scale else column * units.scale(name)
            for name, column in self.columns.items()
        }


def read_table(path: str | os.PathLike[str], *, known: Known | None = None) -> Table:
    """Read a whole file of numbers; see `iter_table`."""
    chunks = list(iter_table(path, known=known))
    first = chunks[0]
    if len(chunks) == 1:
        return first
    columns = {name: np.concatenate([c.columns[name] for c in chunks]) for name in first.columns}
    lines = np.concatenate([chunk.lines for chunk in chunks])
    return Table(first.source, columns, lines, first.scale, first.ignored, first.counted)


def iter_table(
    path: str | os.PathLike[str],
    chunk_rows: int = CHUNK_ROWS,
    *,
    known: Known | None = None,
    doing: str = "reading",
) -> Iterator[Table]:
    """Read a file of numbers, of any length, in tables of up to `chunk_rows` rows.

    A name that ends in .parquet is a Parquet file, all else is CSV. The next chunk is read while
    one is worked on.

    Args:   known: names of the columns to read, see `read_header`. None: all of them.
            doing: what is done with the rows, to be shown as progress through the file.
    Yields: Table: at least one, none of them empty, all with the same columns.
    Raises: InputError: for whatever is not a table of finite numbers, with line and column. Chunks
            before the one with the error have been yielded by then.
    """
    if is_parquet(path):
        from condyle.motion.parquet_file import iter_parquet as read
    else:
        from condyle.motion.csv_file import iter_csv as read
    with step(f"{doing} {Path(path).name}", _size(path)) as advance:
        chunks = read(path, chunk_rows, known)
        # A pipe may keep us waiting, and a thread that waits cannot be interrupted.
        for table, size in _ahead(chunks) if os.path.isfile(path) else chunks:
            yield table
            advance(size)


def is_parquet(path: str | os.PathLike[str]) -> bool:
    """Whether the name of a file says Parquet."""
    return os.fspath(path).lower().endswith(".parquet")


def checked_columns(table: Table) -> Table:
    """The table, if all its numbers are finite.

    Raises: InputError: for the first that is not.
    """
    for name, column in table.columns.items():
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            raise InputError(
                f'{table.where(bad[0])}, column "{name}": got {column[bad[0]]}, expected a finite '
                "number. Fill the gap or leave the row out."
            )
    return table


def _ahead(items: Iterator[T]) -> Iterator[T]:
    """The same items, the next one being made in another thread."""
    end = object()
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(next, items, end)
        while (item := coming.result()) is not end:
            coming = pool.submit(next, items, end)
            yield item  # type: ignore[misc]


def _size(path: str | os.PathLike[str]) -> int | None:
    """Bytes in a file, None for a pipe."""
    return os.path.getsize(path) if os.path.isfile(path) else None
