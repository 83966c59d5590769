"""A pandas DataFrame, or an object like one, as a table. Nothing here imports pandas."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ..errors import InputError, short
from .arrays import as_doubles
from .column_names import Header, read_header
from .number_table import Known, NumberTable, table_of


def as_sampled(given: Any, kind: type, arrays: str) -> Any:
    """A motion or load from what people give for one: itself, the path of a file, a DataFrame.

    Raises: InputError: for anything else; `arrays` is how arrays become one.
    """
    made: Any = kind
    if isinstance(given, kind):
        return given
    if isinstance(given, str | os.PathLike):
        return made.from_csv(given)
    if is_frame(given):
        return made.from_frame(given)
    got, name = type(given).__name__, kind.__name__
    raise InputError(
        f"{name.lower()}: expected a {name}, the path of a file or a DataFrame, got {got}. "
        f"For arrays: {name}.from_arrays({arrays})"
        + (". The order is motion, load" if got in ("Motion", "Load") else "")
    )


def is_frame(data: Any) -> bool:
    """Whether `data` has columns by name, and an index."""
    return all(hasattr(data, name) for name in ("columns", "index", "iloc"))


def table_from_frame(frame: Any, known: Known, source: str) -> NumberTable:
    """The columns of a frame; its index is the time if no column is.

    Raises: InputError: for anything but a frame of finite numbers.
    """
    if not is_frame(frame):
        raise InputError(f"{source}: got a {type(frame).__name__}, expected a pandas DataFrame")
    names = [str(name) for name in frame.columns]
    header = read_header(source, names, known)
    columns = [
        _numbers(frame.iloc[:, i], f'{source}, column "{short(names[i])}"')
        for i in header.index.values()
    ]
    if "t" not in header.index and "t" in known:
        try:
            index = read_header("index", [str(frame.index.name or "t")], ("t",))
        except InputError as error:
            raise InputError(
                f'{source}: has no column "t", nor is its index one ({error})'
            ) from None
        columns.insert(0, _numbers(frame.index, f"{source}, index"))
        places, scale = {"t": -1} | header.index, header.scale | index.scale
        header = Header(places, scale, header.ignored)
    return table_of(source, header, columns, np.arange(1, len(frame) + 1), "row")


def _numbers(values: Any, where: str) -> np.ndarray:
    array = np.asarray(values)
    durations = array.dtype.kind == "m"
    return array / np.timedelta64(1, "s") if durations else as_doubles(values, where)
