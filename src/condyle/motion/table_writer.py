"""Columns of numbers to CSV, with 17 digits, so that reading gives the same bits back."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from types import TracebackType
from typing import Self, TextIO

import numpy as np

from condyle.atomic import replacing

Column = np.ndarray | Sequence[str] | Sequence[float]

_BLOCK = 8192  # rows formatted at once, so that memory stays flat


class TableWriter:
    """Write a table chunk by chunk; the file appears at the end of the `with` block.

        with TableWriter("out.csv") as out:
            for chunk in iter_table("in.csv"):
                out.write({"twice": 2 * chunk.columns["x"]})

    The first chunk sets the columns. NaN becomes an empty cell. After an exception there is no
    file, or the old one; without any chunk likewise.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path
        self._names: list[str] = []
        self._file: TextIO
        self._open: ExitStack

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            temporary = stack.enter_context(replacing(self.path))
            self._file = stack.enter_context(open(temporary, "w", encoding="utf-8", newline=""))
            self._open = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None and not self._names:
            kind, error = _NothingWritten, _NothingWritten()
        self._open.__exit__(kind, error, trace)

    def write(self, columns: Mapping[str, Column]) -> None:
        """Append rows: numbers or strings by column name, all of one length."""
        names = list(columns)
        if names != (self._names or names):
            raise ValueError(f"columns {names} differ from those of the first chunk, {self._names}")
        values = [np.asarray(column) for column in columns.values()]
        sizes = {len(value) for value in values}
        if len(sizes) != 1:
            raise ValueError(f"expected columns of one length, got lengths {sorted(sizes)}")
        if not self._names:
            self._names = names
            self._file.write(",".join(map(_text, names)) + "\n")
        for start in range(0, sizes.pop(), _BLOCK):
            self._file.writelines(_lines([value[start : start + _BLOCK] for value in values]))


def write_table(path: str | os.PathLike[str], columns: Mapping[str, Column]) -> None:
    """Write a table of numbers or strings by column name as CSV, whole or not at all.

    Raises: InputError: if the file cannot be written.
    """
    with TableWriter(path) as out:
        out.write(columns)


class _NothingWritten(Exception):
    """Tells `replacing` to drop a file that never got a header."""


def _lines(values: Sequence[np.ndarray]) -> list[str]:
    numbers = [value.dtype.kind in "biuf" for value in values]
    cells = [
        value.tolist() if number else [_text(str(cell)) for cell in value]
        for value, number in zip(values, numbers, strict=True)
    ]
    form = ",".join("%.17g" if number else "%s" for number in numbers) + "\n"
    rows = list(zip(*cells, strict=True))
    lines = [form % row for row in rows]
    holes = [np.isnan(v) for v, number in zip(values, numbers, strict=True) if number]
    for i in np.flatnonzero(np.logical_or.reduce(holes)) if holes else ():
        lines[i] = ",".join(map(_cell, rows[i])) + "\n"
    return lines


def _cell(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return "" if math.isnan(value) else f"{value:.17g}"


def _text(value: str) -> str:
    """A string as a CSV cell, quoted where it has to be."""
    return '"' + value.replace('"', '""') + '"' if set(value) & set(',;"\t\r\n') else value
