"""CSV as programs and spreadsheets write it, in chunks.

Comma, semicolon or tab between the columns, decimal point or decimal comma, with or without quotes
and byte order mark (UTF-8, or UTF-16 as "Unicode text" is saved), any line ends, spaces around
names and numbers, empty lines at the end, empty columns without a name, a first line "sep=;", lines
of comment that begin with #; and .mot and .sto of OpenSim, whose names follow a line endheader.

A library reads what is plain, a hundred times faster than Python could. What it refuses is read
line by line, to say what is wrong, or to forgive it.
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedReader, FileIO, TextIOWrapper
from typing import BinaryIO

import numpy as np

from .. import limits
from ..errors import InputError, no_such_file
from .column_names import Header, read_header
from .file_words import listed, short, shown_path
from .number_table import Known, NumberTable, table_of

_CELL = 20  # bytes that a number takes with its separator
_HEAD = 200  # lines of a head, at most
# Patterns of strangers' text take time in proportion to its length: no part can be split in two.
NUMBER = re.compile(
    r"[+-]?((\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?|nan|inf(inity)?)", re.ASCII | re.IGNORECASE
)
_CONTROL = bytes(set(range(32)) - set(b"\t\n\r\f"))
_COMMENT = re.compile(r"[ \t\"]*#(?!N/A|REF!|DIV/0!|VALUE!|NAME\?|NUM!|NULL!)")
_HAS_COMMENT = re.compile(rb"^[ \t\"]*#", re.MULTILINE)
HINTS = (
    (
        re.compile(r"[+-]?\d{1,3}([., '\u2019\u00a0\u202f]\d{3})+([.,]\d+)?"),
        " Thousands are written without separators.",
    ),
    (re.compile(r"n/?a|#\S+", re.IGNORECASE), " Fill the gap or leave the row out."),
)


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
) -> Iterator[tuple[NumberTable, int]]:
    """Tables of up to `chunk_rows` rows, and how many bytes of the file each of them took.

    Args: gaps: empty cells are NaN, and no error.
    """
    source = shown_path(path)
    with opened(path) as file:
        storage = source.lower().endswith((".mot", ".sto"))
        head = (_storage_head if storage else read_head)(source, file)
        header = read_header(f"{source}, line {head.line}", head.names, known)
        parser = _Parser(source, head, header, gaps)
        line, block, found = head.first_line, head.rows, False
        size = chunk_rows * len(head.names) * _CELL
        while block := block + file.read(size):
            if not block.endswith(b"\n"):
                block += read_line(file, source)
            values, lines, count = parser.parse(block, line)
            line += count
            for start in range(0, len(lines), chunk_rows):
                found = True
                part = slice(start, start + chunk_rows)
                columns = [column[part] for column in values]
                table = table_of(source, header, columns, lines[part], gaps=gaps)
                yield table, len(block) * table.rows // len(lines)
            block = b""
        if not found:
            raise InputError(f"{source}: has column names but no rows of numbers")


class _Parser:
    """From lines to numbers, for one file. Remembers its decimal sign, and where its rows end."""

    def __init__(self, source: str, head: Head, header: Header, gaps: bool) -> None:
        self.source, self.names, self.separator = source, head.names, head.separator
        self.wanted, self.gaps, self.spaced = [*header.index.values()], gaps, head.spaced
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
        rows, total = len(columns[0]), block.count(b"\n") + (not block.endswith(b"\n"))
        if total > rows:
            self.empty_line = line + rows
        return columns, np.arange(line, line + rows), total

    def _quickly(self, body: bytes) -> list[np.ndarray] | None:
        """By the library; None if it is not sure what every cell means."""
        import pyarrow as pa
        from pyarrow import csv as arrow_csv

        comma = self.separator != "," and b"," in body
        sign = self.decimal or ("," if comma else ".")
        odd_ends = b"\r" in body and body.count(b"\r") != body.count(b"\r\n")
        if sign == self.separator or odd_ends or body.count(b'"') % 2:
            return None
        if b"#" in body and _HAS_COMMENT.search(body):
            return None
        types = {str(i): pa.float64() for i in self.wanted}
        types |= {str(i): pa.null() for i in self.nameless}
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
                    null_values=[""],
                    check_utf8=False,
                    decimal_point=sign,
                ),
            )
        except pa.ArrowException:
            return None
        columns = [table[str(i)] for i in self.wanted]
        whole = table.num_rows == body.count(b"\n") + (not body.endswith(b"\n"))
        if not whole or (not self.gaps and any(column.null_count for column in columns)):
            return None
        self.decimal = self.decimal or (sign if sign.encode() in body else "")
        return [column.to_numpy() for column in columns]

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
            elif self.empty_line:
                raise InputError(
                    f"{self.source}, line {self.empty_line}: is empty, but rows follow. "
                    "Remove the line."
                )
            else:
                rows.append(self._row(text, f"{self.source}, line {at}"))
                lines.append(at)
        values = np.array(rows, dtype=float).reshape(len(rows), len(self.wanted))
        return list(values.T), np.array(lines, dtype=int), len(texts)

    def _row(self, text: str, where: str) -> list[float]:
        if text.count('"') % 2:
            raise InputError(f"{where}: a quotation mark is not closed")
        cells = text.split() if self.spaced else split(text, self.separator, where)
        width = len(self.names)
        while len(cells) > width and not cells[-1]:
            cells.pop()
        while len(cells) < width and not self.names[len(cells)]:
            cells.append("")
        if len(cells) != width:
            commas = self.separator == "," and len(cells) > width
            hint = " Decimal commas need semicolons between the columns." if commas else ""
            named = listed([name for name in self.names if name], "")
            raise InputError(f"{where}: {len(cells)} cells, expected {width} ({named}).{hint}")
        for i in self.nameless:
            if cells[i]:
                raise InputError(
                    f'{where}: got "{short(cells[i])}" in column {i + 1}, which has no name; '
                    "name the column or delete it"
                )
        return [
            self._number(cells[i], f'{where}, column "{short(self.names[i])}"') for i in self.wanted
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
        if not NUMBER.fullmatch(plain):
            hint = next((said for form, said in HINTS if form.fullmatch(cell)), "")
            raise InputError(f'{where}: got "{short(cell)}", expected a number.{hint}')
        self.decimal = self.decimal or sign
        return float(plain)


@dataclass(frozen=True)
class Head:
    """What stands above the rows.

    Attributes: separator: between the cells.
                names: cells of the header, "" where a column has no name.
                line: of the header, from 1.
                rows: what was read of the rows already, and their first line.
                spaced: whether any blanks stand between the cells.
    """

    separator: str
    names: list[str]
    line: int
    rows: bytes
    first_line: int
    spaced: bool = False


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
    found = _head(source, text, separator, line, b"", line + 1)
    if _numbers(found.names):
        above = _head(source, *comment[:1], separator, comment[1], data, line)
        if _numbers(above.names) or len(above.names) != len(found.names):
            raise InputError(f"{source}, line {line}: got numbers, expected names of the columns")
        found = above
    only = found.names[0].partition("[")[0].partition("(")[0].rstrip()
    if len(found.names) == 1 and any(letter == "|" or letter.isspace() for letter in only):
        raise InputError(
            f'{source}, line {found.line}: got one column, "{short(found.names[0])}"; expected '
            "commas, semicolons or tabs between the columns"
        )
    return found


def _storage_head(source: str, file: Source) -> Head:
    """The head of a .mot or .sto file of OpenSim."""
    for line in range(1, _HEAD):
        if read_line(file, source).strip().lower() == b"endheader":
            names = read_line(file, source).decode().split()
            return Head("\t", names, line + 1, b"", line + 2, spaced=True)
    raise InputError(f"{source}: is no .mot or .sto file: it has no line endheader")


def _head(source: str, text: str, separator: str, line: int, rows: bytes, first_line: int) -> Head:
    bare = re.sub('"[^"]*"', "", text)
    separator = separator or next((s for s in ";\t" if s in bare), ",")
    names = split(text.rstrip("\r\n") or "0", separator, f"{source}, line {line}")
    return Head(separator, names, line, rows, first_line)


def _numbers(names: list[str]) -> bool:
    return all(NUMBER.fullmatch(name.replace(",", ".")) for name in names)


def read_line(file: Source, where: str) -> bytes:
    """The next line, or the rest of it.

    Raises: InputError: if it has no end.
    """
    line = file.readline(limits.LINE.most + 1)
    limits.LINE.check(len(line), where)
    return line


def split(line: str, separator: str, where: str) -> list[str]:
    """The cells of a line.

    Raises: InputError: for one that cannot be read.
    """
    try:
        (cells,) = csv.reader([line], delimiter=separator, skipinitialspace=True)
    except csv.Error as error:
        raise InputError(f"{where}: cannot be read ({error})") from error
    return [cell.strip() for cell in cells]


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
