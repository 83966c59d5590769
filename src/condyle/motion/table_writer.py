"""Columns of numbers to CSV, the shortest that read back in the same bits, or to Parquet."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Any, BinaryIO, Self

import numpy as np

from ..errors import InputError
from ..files.atomic import for_parquet, replacing

if TYPE_CHECKING:
    import pyarrow as pa

Column = np.ndarray | Sequence[str] | Sequence[float]

_BLOCK = 16_384  # rows formatted at once, so that memory stays flat
_THREADS = 2
_WAITING = 4  # blocks


class TableWriter:
    """Write a table chunk by chunk; the file appears at the end of the `with` block.

        with TableWriter("out.csv") as out:
            for chunk in iter_table("in.csv"):
                out.write({"twice": 2 * chunk.columns["x"]})

    A name that ends in .parquet makes a Parquet file, in .csv or without an ending, as /dev/stdout,
    a CSV file; others are an InputError. The first chunk sets the columns. NaN becomes
    an empty cell. After an exception there is no file, or the old one; without any chunk likewise.
    """

    def __init__(self, path: str | os.PathLike[str], *, parquet: bool | None = None) -> None:
        self._parquet = for_parquet(path) if parquet is None else parquet
        self._names: list[str] = []
        self._waiting: deque[Future[bytes]] = deque()
        self._to: Any = None
        self._whole = self._written(path)

    def __enter__(self) -> Self:
        self._whole.__enter__()
        return self

    def __exit__(self, *error: Any) -> bool | None:
        return self._whole.__exit__(*error)

    @contextmanager
    def _written(self, path: str | os.PathLike[str]) -> Iterator[None]:
        with suppress(_NothingWritten), ExitStack() as self._open:
            temporary = self._open.enter_context(replacing(path))
            self._file: BinaryIO = self._open.enter_context(open(temporary, "wb"))
            self._pool = self._open.enter_context(ThreadPoolExecutor(_THREADS))
            yield
            self._finish(0)
            if not self._names:
                raise _NothingWritten

    def write(self, columns: Mapping[str, Column]) -> None:
        """Append rows: numbers or strings by column name, all of one length.

        The arrays must not change afterwards: they are formatted in other threads.
        """
        import pyarrow as pa

        names = list(columns)
        if names != (self._names or names):
            raise InputError(
                f"columns: expected those of the first chunk, {self._names}, got {names}"
            )
        if len({len(column) for column in columns.values()}) != 1:
            sizes = sorted({len(column) for column in columns.values()})
            raise InputError(f"columns: expected one length, got {sizes}")
        table = pa.table({name: _array(column) for name, column in columns.items()})
        if not self._names:
            self._names = names
            if not self._parquet:
                self._file.write((",".join(map(quoted_cell, names)) + "\n").encode())
        if self._parquet:
            self._write_parquet(table)
            return
        for start in range(0, table.num_rows, _BLOCK):
            self._waiting.append(self._pool.submit(_csv, table.slice(start, _BLOCK)))
            self._finish(_WAITING)

    def _finish(self, left: int) -> None:
        """Write blocks in their order until `left` are left."""
        while len(self._waiting) > left:
            self._file.write(self._waiting.popleft().result())

    def _write_parquet(self, table: pa.Table) -> None:
        import pyarrow.parquet as pq

        if self._to is None:
            self._to = pq.ParquetWriter(self._file, table.schema)
            self._open.callback(self._to.close)
        self._to.write_table(table)


def write_table(
    path: str | os.PathLike[str], columns: Mapping[str, Column], *, parquet: bool | None = None
) -> None:
    """Write a table of numbers or strings by column name, whole or not at all.

    Args:   parquet: whether as Parquet, else as CSV; default: by the file's ending.
    Raises: InputError: if the file cannot be written.
    """
    with TableWriter(path, parquet=parquet) as out:
        out.write(columns)


class _NothingWritten(Exception):
    """Tells `replacing` to drop a file that never got a header."""


def _array(column: Column) -> pa.Array:
    import pyarrow as pa

    values = np.asarray(column)
    if values.dtype.kind in "biu":
        return pa.array(values.astype(np.int64))
    if values.dtype.kind == "f":
        return pa.array(values.astype(float, copy=False), from_pandas=True)  # NaN is a hole
    return pa.array([str(cell) for cell in values], pa.string())


def _csv(table: pa.Table) -> bytes:
    import pyarrow as pa
    from pyarrow import csv

    texts = [c.unique().to_pylist() for c in table.columns if pa.types.is_string(c.type)]
    style = "needed" if any(quoted_cell(t) != t for text in texts for t in text) else "none"
    out = pa.BufferOutputStream()
    csv.write_csv(table, out, csv.WriteOptions(include_header=False, quoting_style=style))
    return out.getvalue()


def quoted_cell(text: str) -> str:
    """A string as a CSV cell, quoted where it has to be."""
    return '"' + text.replace('"', '""') + '"' if set(text) & set(',;"\t\r\n') else text
