"""Columns of numbers from files: CSV as programs write it, .mot, .sto, .trc, Parquet and MCAP."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import InputError, as_path, short
from ..files import limits
from ..files.reading import note_read, printable_path, require_file
from ..progress import step
from .column_names import read_header
from .csv_file import iter_csv
from .mcap_file import is_mcap, iter_mcap
from .number_table import Known, NumberTable, table_of

CHUNK_ROWS = 16_384
_BUFFER = 1 << 20  # bytes of a column at once; the library's own choice keeps whole files

T = TypeVar("T")


def read_table(
    path: str | os.PathLike[str], *, known: Known | None = None, gaps: bool = False
) -> NumberTable:
    """Read a whole file of numbers; see `iter_table`.

    Raises: InputError: also for a table of too many numbers (limit NUMBERS).
    """
    chunks, count = [], 0
    for chunk in iter_table(path, known=known, gaps=gaps):
        chunks.append(chunk)
        count += chunk.rows * max(1, len(chunk.columns))
        limits.NUMBERS.check(count, printable_path(path))
    columns = {name: np.concatenate([c.columns[name] for c in chunks]) for name in chunk.columns}
    return replace(chunk, columns=columns, lines=np.concatenate([c.lines for c in chunks]))


def iter_table(
    path: str | os.PathLike[str],
    chunk_rows: int = CHUNK_ROWS,
    *,
    known: Known | None = None,
    gaps: bool = False,
    doing: str = "reading",
) -> Iterator[NumberTable]:
    """Read a file of numbers, of any length, in tables of up to `chunk_rows` rows.

    A name that ends in .parquet is a Parquet file, in .mcap one of MCAP, in .mot, .sto or .trc one
    of OpenSim, all else is CSV. The next chunk is read while one is worked on.

    Args:   known: names of the columns to read, see `read_header`. None: all of them.
            gaps: empty cells are NaN, and no error.
            doing: what is done with the rows, to be shown as progress through the file.
    Yields: NumberTable: at least one, none of them empty, all with the same columns.
    Raises: InputError: for whatever is not a table of finite numbers, with line and column. Chunks
            before the one with the error have been yielded by then.
    """
    path = as_path(path)
    read = iter_parquet if is_parquet(path) else iter_mcap if is_mcap(path) else iter_csv
    size_known = os.path.isfile(path)  # of a pipe it is not
    total = os.path.getsize(path) if size_known else None
    note_read(path)
    with step(f"{doing} {Path(path).name}", total) as advance:
        chunks = read(path, chunk_rows, known, gaps)
        # A pipe may keep us waiting, and a thread that waits cannot be interrupted.
        for table, size in _ahead(chunks) if size_known else chunks:
            yield table
            advance(size)


def is_parquet(path: str | os.PathLike[str]) -> bool:
    """Whether the name of a file says Parquet."""
    return as_path(path).lower().endswith(".parquet")


def _ahead(items: Iterator[T]) -> Iterator[T]:
    """The same items, the next one being made in another thread."""
    end = object()
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(next, items, end)
        while (item := coming.result()) is not end:
            coming = pool.submit(next, items, end)
            yield item  # type: ignore[misc]


def iter_parquet(
    path: str | os.PathLike[str], chunk_rows: int, known: Known | None, gaps: bool = False
) -> Iterator[tuple[NumberTable, int]]:
    """Tables of up to `chunk_rows` rows, and how many bytes of the file each of them took.

    Args: gaps: empty cells are NaN, and no error.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    require_file(path)
    source = printable_path(path)
    try:
        with pq.ParquetFile(path, pre_buffer=False, buffer_size=_BUFFER) as file:
            names = file.schema_arrow.names
            header = read_header(source, names, known)
            total = file.metadata.num_rows
            if not total:
                raise InputError(f"{source}: has column names but no rows of numbers")
            wanted = [names[i] for i in header.index.values()]
            size, first = os.path.getsize(path), 1
            for batch in file.iter_batches(chunk_rows, columns=wanted, use_threads=False):
                rows = batch.num_rows
                columns = [
                    _numbers(batch.column(text), f'{source}, column "{short(text)}"', first, gaps)
                    for text in wanted
                ]
                lines = np.arange(first, first + rows)
                table = table_of(source, header, columns, lines, "row", gaps)
                yield table, size * rows // total
                first += rows
            if first != total + 1:
                raise InputError(f"{source}: says it has {total} rows, but {first - 1} came")
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(f"{source}: cannot be read as Parquet ({short(str(error))})") from error


def _numbers(column: Any, where: str, first: int, gaps: bool) -> np.ndarray:
    import pyarrow as pa

    if column.null_count and not gaps:
        row = first + int(np.argmax(column.is_null().to_numpy(zero_copy_only=False)))
        raise InputError(f"{where}, row {row}: the cell is empty; every cell needs a number")
    kind = column.type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
        raise InputError(f"{where}: holds {short(str(kind))}, expected numbers")
    return column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
