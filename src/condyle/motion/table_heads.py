"""Heads of tables: what stands above their rows, names of columns first of all."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import TextIOWrapper
from typing import BinaryIO

from ..errors import InputError, short
from ..files import limits

_LONGEST = 200  # lines of a head
# Patterns of strangers' text take time in proportion to its length: no part can be split in two.
NUMBER = re.compile(
    r"[+-]?((\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?|nan|inf(inity)?)", re.ASCII | re.IGNORECASE
)


class Recoded:
    """UTF-16, or old line ends, as UTF-8 with new ones."""

    def __init__(self, text: TextIOWrapper) -> None:
        self._text = text

    def read(self, size: int) -> bytes:
        return self._text.read(size).encode()

    def readline(self, size: int) -> bytes:
        return self._text.readline(size).encode()


Source = BinaryIO | Recoded  # UTF-8 with line ends that a reader of CSV knows


@dataclass(frozen=True)
class Head:
    """What stands above the rows.

    Attributes: separator: between the cells.
                names: cells of the header, "" where a column has no name.
                line: of the header, from 1.
                rows: what was read of the rows already, and their first line.
                spaced: whether any blanks stand between the cells.
                facts: what else the head says, by key.
                by_threes: whether a row may end before points that were not seen, three cells each.
    """

    separator: str
    names: list[str]
    line: int
    rows: bytes
    first_line: int
    spaced: bool = False
    facts: Mapping[str, str] = field(default_factory=dict)
    by_threes: bool = False


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
    head = _head(source, text, separator, line, b"", line + 1)
    if _numbers(head.names):
        above = _head(source, *comment[:1], separator, comment[1], data, line)
        if _numbers(above.names) or len(above.names) != len(head.names):
            raise InputError(f"{source}, line {line}: got numbers, expected names of the columns")
        head = above
    only = head.names[0].partition("[")[0].partition("(")[0].rstrip()
    if len(head.names) == 1 and any(letter == "|" or letter.isspace() for letter in only):
        raise InputError(
            f'{source}, line {head.line}: got one column, "{short(head.names[0])}"; expected '
            "commas, semicolons or tabs between the columns"
        )
    return head


def storage_head(source: str, file: Source) -> Head:
    """The head of a .mot or .sto file of OpenSim."""
    for line in range(1, _LONGEST):
        if read_line(file, source).strip().lower() == b"endheader":
            names = read_line(file, source).decode().split()
            return Head("\t", names, line + 1, b"", line + 2, spaced=True)
    raise InputError(f"{source}: is no .mot or .sto file: it has no line endheader")


def trc_head(source: str, file: Source) -> Head:
    """The head of a .trc file, five lines: on the fourth a marker's name stands above its X."""
    lines = [read_line(file, source).decode("utf-8-sig").rstrip("\r\n") for _ in range(5)]
    if not lines[0].startswith("PathFileType"):
        raise InputError(f"{source}: is no TRC file: its first line does not begin PathFileType")
    keys, values = map(_cells, lines[1:3])
    if len(values) > len(keys):  # some programs put two tabs between them
        values = [value for value in values if value]
    separator, cells = _separator(lines[3]), _cells(lines[3].rstrip("\t,; "))
    # Above X, Y, Z of a marker stand its name and two empty cells; words have no empty ones.
    labels, rest = (cells[2::3], cells[3::3] + cells[4::3]) if separator else (cells[2:], [])
    if not labels or not all(labels) or any(rest):
        raise InputError(
            f"{source}, line 4: expected Frame#, Time, and the name of each marker above its X"
        )
    names = ["Frame#", "Time", *(f"{label}_{axis}" for label in labels for axis in "xyz")]
    line, rows = 6, read_line(file, source)
    while rows and not rows.strip():
        line, rows = line + 1, read_line(file, source)
    spaced = separator is None or separator.encode() not in rows
    facts = {"PathFileType": lines[0], **dict(zip(keys, values, strict=False))}
    return Head(separator or "\t", names, 4, rows, line, spaced, facts, by_threes=True)


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


def _separator(line: str) -> str | None:
    """What stands between the cells of a line; None: spaces."""
    return next((one for one in "\t;," if one in line), None)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split(_separator(line))]
