"""Logs that are written while a machine runs, so that a process that is killed leaves one."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from threading import Event, Lock, Thread
from typing import Any, BinaryIO, Protocol, Self

import numpy as np

from ..errors import InputError, brief, texts_of
from ..files.atomic import check_writable
from .column_names import read_header
from .mcap_file import McapRows, is_mcap, require_mcap
from .table_writer import quoted_cell

ENDINGS = (".csv", ".mcap")
PERIOD = 0.5  # s, after which rows are handed to the system


class _Rows(Protocol):
    def write(self, row: Sequence[float]) -> None: ...
    def flush(self) -> None: ...
    def finish(self) -> None: ...


class LogWriter:
    """A log that is written row by row, while the machine runs.

        names = ["t", "joint_left", "joint_right", "tau_left", "tau_right"]
        with condyle.LogWriter("log.mcap", names) as log:
            log.write([t, *joints, *efforts])

    Twice a second the rows go to the system, by a thread of its own: a process that is killed
    loses half a second, one whose computer stops what the system has not written. What stands at
    `path` is replaced at once. NaN becomes a gap.

    Args:   path: a file .csv or .mcap (extra `mcap`): a topic `/log` in JSON, as Foxglove plots it.
            names: of the columns, `t` [s] among them; of those that `identify` reads, see there.
    Raises: InputError: if the file cannot be written, or the names are not those of columns.
    """

    def __init__(self, path: str | os.PathLike[str], names: Sequence[str]) -> None:
        self._names = texts_of("names", names, separated=False)
        read_header("names", self._names)
        if "t" not in self._names or not all(self._names):
            raise InputError(f"names: expected t among names, got {brief(list(self._names))}")
        self._path, self._at, self._last = path, self._names.index("t"), -math.inf
        target = check_writable(path, ENDINGS)
        if is_mcap(target):
            require_mcap()
        try:
            self._file: BinaryIO = open(target, "wb")  # noqa: SIM115
        except OSError as error:
            raise self._unwritten(error) from error
        self._failure: OSError | None = None
        self._lock, self._closing = Lock(), Event()
        rows = McapRows if is_mcap(target) else _CsvRows
        self._rows: _Rows = rows(self._file, self._names)
        self._thread: Thread | None = None  # from the first row on

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()

    def write(self, row: Sequence[float] | np.ndarray) -> None:
        """Append a row, (columns,), whose t is greater than that before.

        Raises: InputError: for anything else, after `close`, or where the file cannot be written.
        """
        try:
            numbers = [float(x) for x in row]
        except (TypeError, ValueError, OverflowError):
            numbers = []
        if len(numbers) != len(self._names):
            raise InputError(f"row: expected {len(self._names)} numbers, got {brief(row)}")
        t = numbers[self._at]
        if not self._last < t < math.inf:
            raise InputError(f"t: got {t} s after {self._last} s; expected finite, rising times")
        if self._thread is None:
            self._thread = Thread(target=self._flush, name="log", daemon=True)
            self._thread.start()
        with self._lock:
            if self._closing.is_set():
                raise InputError(f"{self._path}: this log is closed; open another")
            try:
                if self._failure:
                    raise self._failure
                self._rows.write(numbers)
            except OSError as error:
                raise self._unwritten(error) from error
        self._last = t

    def close(self) -> None:
        """Write what is left and end the file.

        Raises: InputError: if it cannot be written.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
        try:
            with self._file:
                if self._failure:
                    raise self._failure
                self._rows.finish()
        except OSError as error:
            raise self._unwritten(error) from error

    def _flush(self) -> None:
        while not self._closing.wait(PERIOD):
            with self._lock:
                try:
                    self._rows.flush()
                except OSError as error:
                    self._failure = error
                    return

    def _unwritten(self, error: OSError) -> InputError:
        return InputError(f"{self._path}: cannot be written ({error.strerror or error})")


class _CsvRows:
    """Rows of CSV."""

    def __init__(self, file: BinaryIO, names: Sequence[str]) -> None:
        self._file = file
        file.write((",".join(map(quoted_cell, names)) + "\n").encode())

    def write(self, row: Sequence[float]) -> None:
        cells = [repr(x) if math.isfinite(x) else "" for x in row]
        self._file.write((",".join(cells) + "\n").encode())

    def flush(self) -> None:
        self._file.flush()

    def finish(self) -> None:
        self._file.flush()
