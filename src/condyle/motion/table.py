"""Columns of numbers from CSV files as programs and spreadsheets write them.

Comma, semicolon or tab between the columns, decimal point or decimal comma, with or without quotes
and byte order mark (UTF-8, or UTF-16 as "Unicode text" is saved), any line ends, spaces around
names, empty lines at the end, empty columns without a name, a first line "sep=;".
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import TextIOWrapper
from itertools import chain, islice
from pathlib import Path

import numpy as np

from condyle.errors import InputError, did_you_mean, no_such_file
from condyle.progress import step

CHUNK_ROWS = 16_384


@dataclass(frozen=True, eq=False)
class Table:
    """Finite numbers by column name, in the order of the file.

    Attributes: source: what to call the table in messages, usually the path as given.
                columns: name -> (rows,).
                first_line: line of the file (from 1) on which row 0 stands.
    """

    source: str
    columns: dict[str, np.ndarray]
    first_line: int = 2

    @property
    def rows(self) -> int:
        return len(next(iter(self.columns.values())))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.columns)

    def where(self, row: int) -> str:
        """'motion.csv, line 57' for a row counted from 0."""
        return f"{self.source}, line {self.first_line + row}"

    def require(self, names: Iterable[str]) -> np.ndarray:
        """The columns `names` side by side, (rows, number of names).

        Raises: InputError: naming every one that is missing.
        """
        names = list(names)
        missing = [name for name in names if name not in self.columns]
        if missing:
            hint = did_you_mean(missing[0], self.columns)
            raise InputError(f"{self.source}: {_listed(missing)} missing.{hint}")
        return np.column_stack([self.columns[name] for name in names])

    def allow(self, known: Collection[str]) -> None:
        """Raise an InputError if there are columns other than `known`."""
        _allow(self.source, self.columns, known)


def read_table(path: str | os.PathLike[str], *, known: Collection[str] | None = None) -> Table:
    """Read a whole CSV file of numbers; see `iter_table`."""
    chunks = list(iter_table(path, known=known))
    first = chunks[0]
    if len(chunks) == 1:
        return first
    columns = {name: np.concatenate([c.columns[name] for c in chunks]) for name in first.columns}
    return Table(first.source, columns, first.first_line)


def iter_table(
    path: str | os.PathLike[str],
    chunk_rows: int = CHUNK_ROWS,
    *,
    known: Collection[str] | None = None,
    doing: str = "reading",
) -> Iterator[Table]:
    """Read a CSV file of numbers, of any length, in tables of up to `chunk_rows` rows.

    Args:   known: column names that may occur; others are an error. None: any may.
            doing: what is done with the rows, to be shown as progress through the file.
    Yields: Table: at least one, none of them empty, all with the same columns.
    Raises: InputError: for whatever is not a table of finite numbers, with line and column. Chunks
            before the one with the error have been yielded by then.
    """
    source = os.fspath(path)
    with _open(path) as file, step(f"{doing} {Path(path).name}", _size(path)) as advance:
        parser, line = _read_header(source, file)
        if known is not None:
            _allow(source, parser.names, known)
        first, held = line, list[str]()
        while read := list(islice(file, chunk_rows)):
            lines = held + read
            size = len(lines)
            while size and not lines[size - 1].strip(parser.blank):
                size -= 1
            held = lines[size:]  # the end of the file, or an error once more rows follow
            if size:
                values = parser.parse(lines[:size], line)
                columns = {name: values[:, j].copy() for j, name in enumerate(parser.names)}
                yield Table(source, columns, line)
                line += size
            advance(sum(map(len, read)))
        if line == first:
            raise InputError(f"{source}: has column names but no rows of numbers")


class _Parser:
    """From lines to numbers, for one file. Remembers its separator and its decimal sign.

    Attributes: names: of the columns;  header: the same with "" where a column has no name, whose
                cells must be empty.
    """

    def __init__(self, source: str, header: Sequence[str], separator: str) -> None:
        self.source, self.header, self.separator = source, header, separator
        self.names = [name for name in header if name]
        self._nameless = [i for i, name in enumerate(header) if not name]
        self.blank = separator + ' "\n\t'
        self.decimal = ""

    def parse(self, lines: Sequence[str], first_line: int) -> np.ndarray:
        """Numbers of the lines, (rows, columns): at once if all is plain, else cell by cell."""
        comma = self.separator != "," and any("," in line for line in lines)
        point = any("." in line for line in lines)
        sign = "," if comma else "." if point else self.decimal
        plain = not (comma and point) and self.decimal in ("", sign)
        if plain and all(line.isascii() and not _ODD.search(line) for line in lines):
            text = (line.replace(",", ".") for line in lines) if comma else lines
            rows = [line.split(self.separator) for line in text]
            if self._nameless:
                rows = [self._named(row) for row in rows]
            if all(len(row) == len(self.names) for row in rows):
                with suppress(ValueError):  # the careful way says where
                    cells = chain.from_iterable(rows)
                    values = np.fromiter(map(float, cells), float, len(rows) * len(self.names))
                    if np.isfinite(values).all():
                        self.decimal = sign
                        return values.reshape(len(rows), len(self.names))
        return np.array([self._row(line, first_line + i) for i, line in enumerate(lines)])

    def _named(self, row: list[str]) -> list[str]:
        """The cells of columns with a name; none where the row needs a careful look."""
        if len(row) != len(self.header) or any(row[i].strip() for i in self._nameless):
            return []
        return [cell for cell, name in zip(row, self.header, strict=True) if name]

    def _row(self, text: str, line: int) -> list[float]:
        where = f"{self.source}, line {line}"
        if not text.strip(self.blank):
            raise InputError(f"{where}: is empty, but rows follow. Remove the line.")
        if text.count('"') % 2:
            raise InputError(f"{where}: a quotation mark is not closed")
        try:
            cells = next(_split([text], self.separator))
        except csv.Error as error:
            raise InputError(f"{where}: cannot be read ({error})") from error
        while len(cells) > len(self.header) and not cells[-1].strip():
            cells.pop()
        while len(cells) < len(self.header) and not self.header[len(cells)]:
            cells.append("")
        if len(cells) != len(self.header):
            hint = ""
            if self.separator == "," and len(cells) > len(self.header):
                hint = " Decimal commas need semicolons between the columns."
            raise InputError(
                f"{where}: {len(cells)} cells, expected {len(self.header)}"
                f" ({', '.join(self.names)}).{hint}"
            )
        for i, (cell, name) in enumerate(zip(cells, self.header, strict=True)):
            if cell.strip() and not name:
                raise InputError(
                    f'{where}: got "{_short(cell)}" in column {i + 1}, which has no name; name the '
                    "column or delete it"
                )
        return [
            self._number(cell.strip(), f'{where}, column "{name}"')
            for cell, name in zip(cells, self.header, strict=True)
            if name
        ]

    def _number(self, cell: str, where: str) -> float:
        if not cell:
            raise InputError(f"{where}: the cell is empty; every cell needs a number")
        sign = "," if "," in cell else "." if "." in cell else ""
        if sign and self.decimal and sign != self.decimal:
            raise InputError(
                f'{where}: got "{_short(cell)}" where the numbers before have "{self.decimal}" '
                "as their decimal sign. Use one sign, and no thousands separators."
            )
        plain = cell.replace(",", ".") if cell.count(",") == 1 else cell
        if _NUMBER.fullmatch(plain):
            self.decimal = self.decimal or sign
            if math.isfinite(value := float(plain)):
                return value
            raise InputError(f"{where}: {_short(cell)} is too large for a number")
        if _NOT_FINITE.fullmatch(cell):
            raise InputError(
                f'{where}: got "{_short(cell)}", expected a finite number.'
                " Fill the gap or leave the row out."
            )
        hint = " Thousands are written without separators." if _GROUPED.fullmatch(cell) else ""
        raise InputError(f'{where}: got "{_short(cell)}", expected a number.{hint}')


def _split(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    return csv.reader(lines, delimiter=separator, skipinitialspace=True)


_ODD = re.compile('[_"]')  # what float() would take and we would not, or has to be unpacked
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_GROUPED = re.compile(r"[+-]?\d{1,3}([., '\u2019\u00a0\u202f]\d{3})+([.,]\d+)?")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)|n/?a|#\S+", re.IGNORECASE)


def _read_header(source: str, file: TextIOWrapper) -> tuple[_Parser, int]:
    """The parser for the file, and the line on which the rows begin."""
    separator, line = "", 0
    for text in file:
        line += 1
        if text.lower().startswith("sep=") and len(text.rstrip("\n")) == 5:
            separator = text[4]
        elif text.strip(';, "\t\n'):
            break
    else:
        raise InputError(f"{source}: is empty; expected a row of column names, then numbers")
    bare = re.sub('"[^"]*"', "", text)
    separator = separator or next((s for s in ";\t" if s in bare), ",")
    names = [name.strip() for name in next(_split([text], separator))]
    where = f"{source}, line {line}"
    if all(_NUMBER.fullmatch(name.replace(",", ".")) for name in names):
        raise InputError(f"{where}: got numbers, expected the names of the columns")
    if len(names) == 1 and re.search(r"[\s|]", names[0]):
        raise InputError(
            f'{where}: got one column, "{_short(names[0])}"; expected commas, semicolons or tabs '
            "between the columns"
        )
    if twice := sorted({name for name in names if name and names.count(name) > 1}):
        raise InputError(f"{where}: {_listed(twice)} given more than once")
    return _Parser(source, names, separator), line + 1


@contextmanager
def _open(path: str | os.PathLike[str]) -> Iterator[TextIOWrapper]:
    """The file as text, or an InputError that says why not."""
    if "\0" in os.fspath(path):
        raise InputError(f"{os.fspath(path)!r}: is not the name of a file")
    try:
        with open(path, "rb") as raw:
            head = raw.peek(1 << 16)
            wide = head.startswith((b"\xff\xfe", b"\xfe\xff"))
            if head.startswith(b"PK\x03\x04"):
                raise InputError(f"{path}: is a spreadsheet or zip file; save the sheet as CSV")
            if not wide and head.translate(None, _CONTROL) != head:
                raise InputError(f"{path}: is not text; expected a CSV file")
            with TextIOWrapper(raw, encoding="utf-16" if wide else "utf-8-sig") as text:
                yield text
    except FileNotFoundError as error:
        raise no_such_file(path) from error
    except IsADirectoryError as error:
        raise InputError(f"{path}: is a folder; give the name of a CSV file in it") from error
    except UnicodeError as error:
        raise InputError(f"{path}: is not UTF-8 text ({error}); save it as CSV UTF-8") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error


def _size(path: str | os.PathLike[str]) -> int | None:
    """Bytes in a file, None for a pipe."""
    return os.path.getsize(path) if os.path.isfile(path) else None


_CONTROL = bytes(set(range(32)) - set(b"\t\n\r\f"))


def _allow(source: str, names: Iterable[str], known: Collection[str]) -> None:
    unknown = [name for name in names if name not in known]
    if unknown:
        hint = did_you_mean(unknown[0], known)
        raise InputError(f"{source}: {_listed(unknown)} not known here.{hint}")


def _listed(names: Sequence[str]) -> str:
    quoted = ", ".join(f'"{_short(name)}"' for name in names)
    return f"column {quoted} is" if len(names) == 1 else f"columns {quoted} are"


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."
