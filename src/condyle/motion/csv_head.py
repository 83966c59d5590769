"""The beginning of a CSV file: its separator, its columns, and where the rows start."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedReader, FileIO, TextIOWrapper
from typing import Protocol

from ..errors import InputError, no_such_file
from .file_words import short, shown_path

LONGEST = 1 << 24  # bytes of a line: beyond, it is no table
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)

_CONTROL = bytes(set(range(32)) - set(b"\t\n\r\f"))


class Source(Protocol):
    """UTF-8 with any line ends that a reader of CSV knows."""

    def read(self, size: int, /) -> bytes: ...
    def readline(self, size: int, /) -> bytes: ...


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
    if len(head.names) == 1 and re.search(r"[\s|]", re.sub(r"\s*[\[(].*", "", only)):
        raise InputError(
            f'{source}, line {head.line}: got one column, "{short(only)}"; expected commas, '
            "semicolons or tabs between the columns"
        )
    return head


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[Source]:
    """The file as UTF-8, or an InputError that says why not."""
    if "\0" in os.fspath(path):
        raise InputError(f"{os.fspath(path)!r}: is not the name of a file")
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


class _Recoded:
    """UTF-16, or old line ends, as UTF-8 with new ones."""

    def __init__(self, text: TextIOWrapper) -> None:
        self._text = text

    def read(self, size: int) -> bytes:
        return self._text.read(size).encode()

    def readline(self, size: int) -> bytes:
        return self._text.readline(size).encode()
