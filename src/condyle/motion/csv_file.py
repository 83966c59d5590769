"""CSV as programs and spreadsheets write it, in chunks.

Comma, semicolon or tab between the columns, decimal point or decimal comma, with or without quotes
and byte order mark (UTF-8, or UTF-16 as "Unicode text" is saved), any line ends, spaces around
names and numbers, empty lines at the end, empty columns without a name, a first line "sep=;", lines
of comment that begin with #; and .mot, .sto and .trc of OpenSim, which have heads of their own.

A library reads what is plain, a hundred times faster than Python could. What it refuses is read
line by line, to say what is wrong, or to forgive it.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BufferedReader, FileIO, TextIOWrapper

import numpy as np

from ..errors import InputError, join, short
from ..files.reading import no_such_file, printable_path
from .column_names import Header, read_header
from .number_table import Known, NumberTable, table_of
from .table_heads import (
    NUMBER,
    Head,
    Recoded,
    Source,
    read_head,
    read_line,
    split,
    storage_head,
    trc_head,
)

HEADS = {".mot": storage_head, ".sto": storage_head, ".trc": trc_head}
_CELL = 20  # bytes that a number takes with its separator
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


def iter_csv(
    path: str | os.PathLike[str], chunk_rows: int, known: Known | None, gaps: bool = False
) -> Iterator[tuple[NumberTable, int]]:
    """Tables of up to `chunk_rows` rows, and how many bytes of the file each of them took.

    Args: gaps: empty cells are NaN, and no error.
    """
    source = printable_path(path)
    with opened(path) as file:
        head = HEADS.get(source.lower()[-4:], read_head)(source, file)
        header = read_header(f"{source}, line {head.line}", head.names, known)
        parser, notes = _Parser(source, head, header, gaps), list[str]()
        line, block, any_rows = head.first_line, head.rows, False
        size = chunk_rows * len(head.names) * _CELL
        while block := block + file.read(size):
            if not block.endswith(b"\n"):
                block += read_line(file, source)
            values, lines, count = parser.parse(block, line)
            line += count
            for start in range(0, len(lines), chunk_rows):
                any_rows = True
                part = slice(start, start + chunk_rows)
                columns = [column[part] for column in values]
                table = table_of(source, header, columns, lines[part], gaps=gaps)
                table = replace(table, facts=head.facts, notes=notes)
                yield table, len(block) * table.rows // len(lines)
            block = b""
        if not any_rows:
            raise InputError(f"{source}: has column names but no rows of numbers")
        notes += parser.notes()


class _Parser:
    """A parser of one file's lines. Remembers its decimal sign, and where its rows end."""

    def __init__(self, source: str, head: Head, header: Header, gaps: bool) -> None:
        self.source, self.names, self.separator = source, head.names, head.separator
        self.wanted, self.gaps, self.spaced = [*header.index.values()], gaps, head.spaced
        self.nameless = [i for i, name in enumerate(head.names) if not name]
        self.blank = head.separator + ' "\n\t\r\f'
        self.decimal = ""
        self.empty_line = 0  # the first since the last row
        self.by_threes, self.unseen = head.by_threes, list[int]()
        self.cut, self.cut_line = "", 0

    def notes(self) -> list[str]:
        """What was read otherwise than it stands, for whoever reads the results."""
        sentences = []
        if self.cut:
            sentences.append(
                f"{self.source}: its last row (line {self.cut_line}) is cut short and left out; if "
                "that is not all, copy or export it again"
            )
        if self.unseen:
            sentences.append(
                f"{self.source}: {len(self.unseen)} of its rows, the first on line "
                f"{self.unseen[0]}, end before {len(self.names)} cells; markers without cells "
                "count as not seen there"
            )
        return sentences

    def parse(self, block: bytes, line: int) -> tuple[list[np.ndarray], np.ndarray, int]:
        """Columns, lines on which their rows stand, and the number of lines in the block."""
        end = block.find(b"\n", len(block.rstrip(self.blank.encode()))) + 1 or len(block)
        body = block[:end] if block.rstrip(self.blank.encode()) else b""
        columns = self._quickly(body) if body and not (self.empty_line or self.cut) else None
        if columns is None:
            return self._carefully(block, line)
        rows, total = len(columns[0]), block.count(b"\n") + (not block.endswith(b"\n"))
        if total > rows:
            self.empty_line = line + rows
        return columns, np.arange(line, line + rows), total

    def _quickly(self, body: bytes) -> list[np.ndarray] | None:
        """Columns by the library; None if it is not sure what every cell means."""
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
        ended = not texts[-1]
        if ended:
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
            elif self.cut:
                raise InputError(self.cut)
            elif cells := self._cells(text, at, ended or at < line + len(texts) - 1):
                rows.append(self._row(cells, f"{self.source}, line {at}"))
                lines.append(at)
        values = np.array(rows, dtype=float).reshape(len(rows), len(self.wanted))
        return list(values.T), np.array(lines, dtype=int), len(texts)

    def _cells(self, text: str, line: int, ended: bool) -> list[str]:
        """The cells of a row; none of one that is cut short.

        Args: ended: whether the line has an end.
        """
        where = f"{self.source}, line {line}"
        if text.count('"') % 2:
            raise InputError(f"{where}: a quotation mark is not closed")
        cells = text.split() if self.spaced else split(text, self.separator, where)
        width = len(self.names)
        while len(cells) > width and not cells[-1]:
            cells.pop()
        while len(cells) < width and not self.names[len(cells)]:
            cells.append("")
        missing = width - len(cells)
        if self.by_threes and ended and len(cells) > 2 and missing > 0 and missing % 3 == 0:
            self.unseen.append(line)
            cells += [""] * missing
        if len(cells) != width:
            commas = self.separator == "," and len(cells) > width
            hint = " Decimal commas need semicolons between the columns." if commas else ""
            named = join([name for name in self.names if name])
            wrong = f"{where}: {len(cells)} cells, expected {width} ({named}).{hint}"
            if not self.by_threes or len(cells) > width:
                raise InputError(wrong)
            self.cut_line, self.cut = line, wrong  # an error if another row follows
            return []
        return cells

    def _row(self, cells: list[str], where: str) -> list[float]:
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


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[Source]:
    """The file as UTF-8, or an InputError that says why not."""
    label = printable_path(path)
    try:
        with FileIO(path) as bare, BufferedReader(bare, 1 << 17) as raw:
            head = raw.peek(1 << 16)
            utf16 = head.startswith((b"\xff\xfe", b"\xfe\xff"))
            if head.startswith(b"PK\x03\x04"):
                raise InputError(f"{label}: is a spreadsheet or zip file; save the sheet as CSV")
            if head.startswith(b"PAR1"):
                raise InputError(f"{label}: is a Parquet file; its name must end in .parquet")
            if not utf16 and head.translate(None, _CONTROL) != head:
                raise InputError(f"{label}: is not text; expected a CSV file")
            if utf16 or re.search(rb"\r[^\n]", head):
                yield Recoded(TextIOWrapper(raw, encoding="utf-16" if utf16 else "utf-8"))
            else:
                yield raw
    except FileNotFoundError as error:
        raise no_such_file(path) from error
    except IsADirectoryError as error:
        raise InputError(f"{label}: is a folder; give the name of a CSV file in it") from error
    except UnicodeError as error:
        raise InputError(f"{label}: is not UTF-8 text ({error}); save it as CSV UTF-8") from error
    except OSError as error:
        raise InputError(f"{label}: cannot be read ({error.strerror or error})") from error
