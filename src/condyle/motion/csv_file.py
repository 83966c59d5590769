"""CSV as programs and spreadsheets write it, in chunks.

Comma, semicolon or tab between the columns, decimal point or decimal comma, with or without quotes
and byte order mark (UTF-8, or UTF-16 as "Unicode text" is saved), any line ends, spaces around
names and numbers, empty lines at the end, empty columns without a name, a first line "sep=;", lines
of comment that begin with #.

A library reads what is plain, a hundred times faster than Python could. What it refuses is read
line by line, to say what is wrong, or to forgive it.
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedReader, FileIO, TextIOWrapper
from typing import BinaryIO

import numpy as np

from ..errors import InputError, no_such_file
from .column_names import Header, read_header
from .file_words import listed, short, shown_path
from .number_table import Known, Table, table_of

_CELL = 20  # bytes that a number takes with its separator
LONGEST = 1 << 24  # bytes of a line: beyond, it is no table
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)

_CONTROL = bytes(set(range(32)) - set(b"\t\n\r\f"))

_COMMENT = re.compile(r"[ \t\"]*#(?!N/A|REF!|DIV/0!|VALUE!|NAME\?|NUM!|NULL!)")
_HAS_COMMENT = re.compile(rb"^[ \t\"]*#", re.MULTILINE)
_GROUPED = re.compile(r"[+-]?\d{1,3}([., '\u2019\u00a0\u202f]\d{3})+([.,]\d+)?")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)|n/?a|#\S+", re.IGNORECASE)


class _Recoded:
    """UTF-16, or old line ends, as UTF-8 with new ones."""

    def __init__(self, text: TextIOWrapper) -> None:
        self._text = text

    def read(self, size: int) -> bytes:
        return self._text.read(size).encode()

    def readline(self, size: int) -> bytes:
        return self._text.readline(size).encode()


Source = BinaryIO | _Recoded  # UTF-8 with line ends that a reader of CSV knows


def iter_csv(
    path: str | os.PathLike[str], chunk_rows: int, known: Known | None, gaps: bool = False
) -> Iterator[tuple[Table, int]]:
    """Tables of up to `chunk_rows` rows, and how many bytes of the file each of them took.

    Args: gaps: empty cells are NaN, and no error.
    """
    source = shown_path(path)
    with opened(path) as file:
        head = read_head(source, file)
        header = read_header(f"{source}, line {head.line}", head.names, known)
        parser = _Parser(source, head, header, gaps)
        line, block, found = head.first_line, head.rows, False
        while block := block + _block(file, chunk_rows * len(head.names) * _CELL, source):
            values, lines, count = parser.parse(block, line)
            line += count
            for start in range(0, len(lines), chunk_rows):
                found = True
                part = slice(start, start + chunk_rows)
                share = len(block) * len(lines[part]) // len(lines)
                columns = [column[part] for column in values]
                yield table_of(source, header, columns, lines[part], checked=False), share
            block = b""
        if not found:
            raise InputError(f"{source}: has column names but no rows of numbers")


def _block(file: Source, size: int, source: str) -> bytes:
    """Whole lines, of about `size` bytes."""
    block = file.read(size)
    return block if not block or block.endswith(b"\n") else block + read_line(file, source)


class _Parser:
    """From lines to numbers, for one file. Remembers its separator and its decimal sign."""

    def __init__(self, source: str, head: Head, header: Header, gaps: bool) -> None:
        self.source, self.names, self.separator = source, head.names, head.separator
        self.gaps = gaps
        self.wanted = {i: name for name, i in header.index.items()}
        self.nameless = [i for i, name in enumerate(head.names) if not name]
        self.blank = head.separator + ' "\n\t\r\f'
        self.decimal = ""
        self.empty_line = 0  # the first since the last row

    def parse(self, block: bytes, line: int) -> tuple[list[np.ndarray], np.ndarray, int]:
        """Columns, lines on which their rows stand, and the number of lines in the block."""
        end = block.find(b"\n", len(block.rstrip(self.blank.encode()))) + 1 or len(block)
        body = block[:end] if block.rstrip(self.blank.encode()) else b""
        columns = self._quickly(body) if body and not self.empty_line else None
        if columns is None:
            return self._carefully(block, line)
        rows = len(columns[0])
        total = block.count(b"\n") + (not block.endswith(b"\n"))
        if total > rows:
            self.empty_line = line + rows
        return columns, np.arange(line, line + rows), total

    def _quickly(self, body: bytes) -> list[np.ndarray] | None:
        """By the library; None if it is not sure what every cell means."""
        import pyarrow as pa
        import pyarrow.compute as pc
        from pyarrow import csv as arrow_csv

        comma = self.separator != "," and b"," in body
        sign = self.decimal or ("," if comma else ".")
        odd_ends = b"\r" in body and body.count(b"\r") != body.count(b"\r\n")
        if sign == self.separator or odd_ends or body.count(b'"') % 2:
            return None
        if b"#" in body and _HAS_COMMENT.search(body):
            return None
        types = {str(i): pa.float64() for i in self.wanted}
        types |= {str(i): pa.binary() for i in self.nameless}
        try:
            table = arrow_csv.read_csv(
                pa.BufferReader(body),
                arrow_csv.ReadOptions(
                    use_threads=False,
                    block_size=len(body) + 1,
                    column_names=[str(i) for i in range(len(self.names))],
                ),
                arrow_csv.ParseOptions(delimiter=self.separator, ignore_empty_lines=False),
                arrow_csv.ConvertOptions(
                    column_types=types,
                    include_columns=list(types),
                    null_values=[""] if self.gaps else [],
                    check_utf8=False,
                    decimal_point=sign,
                ),
            )
        except pa.ArrowException:
            return None
        if table.num_rows != body.count(b"\n") + (not body.endswith(b"\n")):
            return None
        if any(pc.max(pc.binary_length(table[str(i)])).as_py() for i in self.nameless):
            return None
        columns = [table[str(i)].to_numpy() for i in self.wanted]
        if not self.gaps and not all(np.isfinite(column).all() for column in columns):
            return None
        self.decimal = self.decimal or (sign if sign.encode() in body else "")
        return columns

    def _carefully(self, block: bytes, line: int) -> tuple[list[np.ndarray], np.ndarray, int]:
        texts = re.split(r"\r\n|\r|\n", block.decode())
        if not texts[-1]:
            texts.pop()
        rows, lines = [], []
        for at, text in enumerate(texts, line):
            if _COMMENT.match(text):
                continue
            if not text.strip(self.blank):
                self.empty_line = self.empty_line or at
                continue
            if self.empty_line:
                raise InputError(
                    f"{self.source}, line {self.empty_line}: is empty, but rows follow. "
                    "Remove the line."
                )
            rows.append(self._row(text, f"{self.source}, line {at}"))
            lines.append(at)
        values = np.array(rows, dtype=float).reshape(len(rows), len(self.wanted))
        return list(values.T), np.array(lines, dtype=int), len(texts)

    def _row(self, text: str, where: str) -> list[float]:
        if text.count('"') % 2:
            raise InputError(f"{where}: a quotation mark is not closed")
        try:
            cells = next(split([text], self.separator))
        except csv.Error as error:
            raise InputError(f"{where}: cannot be read ({error})") from error
        while len(cells) > len(self.names) and not cells[-1].strip():
            cells.pop()
        while len(cells) < len(self.names) and not self.names[len(cells)]:
            cells.append("")
        if len(cells) != len(self.names):
            hint = ""
            if self.separator == "," and len(cells) > len(self.names):
                hint = " Decimal commas need semicolons between the columns."
            named = listed([name for name in self.names if name], "")
            raise InputError(
                f"{where}: {len(cells)} cells, expected {len(self.names)} ({named}).{hint}"
            )
        for i in self.nameless:
            if cells[i].strip():
                raise InputError(
                    f'{where}: got "{short(cells[i])}" in column {i + 1}, which has no name; '
                    "name the column or delete it"
                )
        return [
            self._number(cells[i].strip(), f'{where}, column "{short(self.names[i])}"')
            for i in self.wanted
        ]

    def _number(self, cell: str, where: str) -> float:
        if not cell and self.gaps:
            return math.nan
        if not cell:
            raise InputError(f"{where}: the cell is empty; every cell needs a number")
        sign = "," if "," in cell else "." if "." in cell else ""
        if sign and self.decimal and sign != self.decimal:
            raise InputError(
                f'{where}: got "{short(cell)}" where the numbers before have "{self.decimal}" '
                "as their decimal sign. Use one sign, and no thousands separators."
            )
        plain = cell.replace(",", ".") if cell.count(",") == 1 else cell
        if NUMBER.fullmatch(plain):
            self.decimal = self.decimal or sign
            if math.isfinite(value := float(plain)):
                return value
            raise InputError(f"{where}: {short(cell)} is too large for a number")
        if _NOT_FINITE.fullmatch(cell):
            raise InputError(
                f'{where}: got "{short(cell)}", expected a finite number.'
                " Fill the gap or leave the row out."
            )
        hint = " Thousands are written without separators." if _GROUPED.fullmatch(cell) else ""
        raise InputError(f'{where}: got "{short(cell)}", expected a number.{hint}')


@dataclass(frozen=True)
class Head:
    """What stands above the rows.

    Attributes: separator: between the cells.
                names: cells of the header, "" where a column has no name.
                line: of the header, from 1.
                rows: what was read of the rows already, and their first line.
    """

    separator: str
    names: list[str]
    line: int
    rows: bytes
    first_line: int


def read_head(source: str, file: Source) -> Head:
    """The head of a file. Names may stand in the last comment, as `numpy.savetxt` writes them."""
    separator, line, comment = "", 0, ("", 0)
    while data := read_line(file, f"{source}, line {line + 1}"):
        line += 1
        text = data.decode("utf-8-sig" if line == 1 else "utf-8")
        if text.lower().startswith("sep=") and len(text.rstrip("\r\n")) == 5:
            separator = text[4]
            if separator not in ",;\t|":
                raise InputError(
                    f"{source}, line {line}: got {short(text.strip())!r}, expected sep=;"
                )
        elif text.lstrip(' "').startswith("#"):
            comment = (text.lstrip(' "#'), line)
        elif text.strip(';, "\t\r\n'):
            break
    else:
        raise InputError(f"{source}: is empty; expected a row of column names, then numbers")
    names, between = _cells(text, separator, f"{source}, line {line}")
    if not _numbers(names):
        return _checked(source, Head(between, names, line, b"", line + 1))
    if comment[0]:
        above, between = _cells(comment[0], separator, f"{source}, line {comment[1]}")
        if len(above) == len(names) and not _numbers(above):
            return _checked(source, Head(between, above, comment[1], data, line))
    raise InputError(f"{source}, line {line}: got numbers, expected the names of the columns")


def read_line(file: Source, where: str) -> bytes:
    """The next line, or the rest of it.

    Raises: InputError: if it has no end.
    """
    line = file.readline(LONGEST)
    if len(line) == LONGEST:
        raise InputError(f"{where}: is longer than {LONGEST >> 20} MB; expected a table of numbers")
    return line


def split(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    """Cells of lines."""
    return csv.reader(lines, delimiter=separator, skipinitialspace=True)


def _cells(text: str, separator: str, where: str) -> tuple[list[str], str]:
    bare = re.sub('"[^"]*"', "", text)
    separator = separator or next((s for s in ";\t" if s in bare), ",")
    try:
        return [name.strip() for name in next(split([text], separator))], separator
    except csv.Error as error:
        raise InputError(f"{where}: the names of the columns cannot be read ({error})") from error


def _numbers(names: list[str]) -> bool:
    return all(NUMBER.fullmatch(name.replace(",", ".")) for name in names)


def _checked(source: str, head: Head) -> Head:
    only = head.names[0]
    if len(head.names) == 1 and re.search(r"[\s|]", re.split(r"[\[(]", only)[0].rstrip()):
        raise InputError(
            f'{source}, line {head.line}: got one column, "{short(only)}"; expected commas, '
            "semicolons or tabs between the columns"
        )
    return head


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[Source]:
    """The file as UTF-8, or an InputError that says why not."""
    shown = shown_path(path)
    try:
        with FileIO(path) as bare, BufferedReader(bare, 1 << 17) as raw:
            head = raw.peek(1 << 16)
            wide = head.startswith((b"\xff\xfe", b"\xfe\xff"))
            if head.startswith(b"PK\x03\x04"):
                raise InputError(f"{shown}: is a spreadsheet or zip file; save the sheet as CSV")
            if head.startswith(b"PAR1"):
                raise InputError(f"{shown}: is a Parquet file; its name must end in .parquet")
            if not wide and head.translate(None, _CONTROL) != head:
                raise InputError(f"{shown}: is not text; expected a CSV file")
            if wide or re.search(rb"\r[^\n]", head):
                yield _Recoded(TextIOWrapper(raw, encoding="utf-16" if wide else "utf-8"))
            else:
                yield raw
    except FileNotFoundError as error:
        raise no_such_file(path) from error
    except IsADirectoryError as error:
        raise InputError(f"{shown}: is a folder; give the name of a CSV file in it") from error
    except UnicodeError as error:
        raise InputError(f"{shown}: is not UTF-8 text ({error}); save it as CSV UTF-8") from error
    except OSError as error:
        raise InputError(f"{shown}: cannot be read ({error.strerror or error})") from error
