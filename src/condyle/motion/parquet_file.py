"""Parquet, in chunks."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import InputError, no_such_file
from .column_names import read_header
from .file_words import short, shown_path
from .number_table import Known, Table, table_of

_BUFFER = 1 << 20  # bytes of a column at once; the library's own choice keeps whole files


def iter_parquet(
    path: str | os.PathLike[str], chunk_rows: int, known: Known | None, gaps: bool = False
) -> Iterator[tuple[Table, int]]:
    """Tables of up to `chunk_rows` rows, and how many bytes of the file each of them took.

    Args: gaps: empty cells are NaN, and no error.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not os.path.exists(path):
        raise no_such_file(path)
    source = shown_path(path)
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
                table = table_of(source, header, columns, lines, "row", checked=not gaps)
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
