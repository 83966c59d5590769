"""Columns of numbers from files: CSV as programs and spreadsheets write it, and Parquet."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..errors import as_path
from ..progress import step
from .number_table import Known, Table

CHUNK_ROWS = 16_384

T = TypeVar("T")


def read_table(
    path: str | os.PathLike[str], *, known: Known | None = None, gaps: bool = False
) -> Table:
    """Read a whole file of numbers; see `iter_table`."""
    chunks = list(iter_table(path, known=known, gaps=gaps))
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
    gaps: bool = False,
    doing: str = "reading",
) -> Iterator[Table]:
    """Read a file of numbers, of any length, in tables of up to `chunk_rows` rows.

    A name that ends in .parquet is a Parquet file, all else is CSV. The next chunk is read while
    one is worked on.

    Args:   known: names of the columns to read, see `read_header`. None: all of them.
            gaps: empty cells are NaN, and no error.
            doing: what is done with the rows, to be shown as progress through the file.
    Yields: Table: at least one, none of them empty, all with the same columns.
    Raises: InputError: for whatever is not a table of finite numbers, with line and column. Chunks
            before the one with the error have been yielded by then.
    """
    if is_parquet(path := as_path(path)):
        from .parquet_file import iter_parquet as read  # pyarrow takes a while
    else:
        from .csv_file import iter_csv as read
    size_known = os.path.isfile(path)  # of a pipe it is not
    total = os.path.getsize(path) if size_known else None
    with step(f"{doing} {Path(path).name}", total) as advance:
        chunks = read(path, chunk_rows, known, gaps)
        # A pipe may keep us waiting, and a thread that waits cannot be interrupted.
        for table, size in _ahead(chunks) if size_known else chunks:
            yield table
            advance(size)


def is_parquet(path: str | os.PathLike[str]) -> bool:
    """Whether the name of a file says Parquet."""
    return os.fspath(path).lower().endswith(".parquet")


def _ahead(items: Iterator[T]) -> Iterator[T]:
    """The same items, the next one being made in another thread."""
    end = object()
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(next, items, end)
        while (item := coming.result()) is not end:
            coming = pool.submit(next, items, end)
            yield item  # type: ignore[misc]
